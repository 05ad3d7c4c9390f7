"""Footage with exact truth, rendered from bodies that are not the tracker's model."""
