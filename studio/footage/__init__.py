"""Footage and its cameras: reading it, and where the cameras stand."""
