"""Runs of running cameras, and their replay."""
