"""Rotations, rigid motions, cameras and projected cones (mm, radians, world z up)."""
