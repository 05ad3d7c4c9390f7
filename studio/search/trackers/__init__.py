"""Stochastic search, a layer at a time; sees a function of poses, never an image."""
