"""The viser scene of a window: a pure model, views that draw it, and one thread that owns both."""

METRES_PER_MM = 0.001
"""The scene is drawn in metres; everything else in the studio is in mm."""
