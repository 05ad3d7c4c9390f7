"""The inside of a stored run: the numbers of the views that show how its search went, and why a frame failed."""
