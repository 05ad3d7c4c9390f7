"""What the papers leave open: how much damage each tracker stands."""
