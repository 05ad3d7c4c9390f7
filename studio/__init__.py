"""Capture studio: recover articulated motion from calibrated cameras by stochastic search, and watch the search."""
