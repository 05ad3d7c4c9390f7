"""Questions that the papers leave open: accuracy on other footage, tolerance of damage."""
