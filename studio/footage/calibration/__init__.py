"""Cameras solved from boards, floor and axes, and checks of a calibration in words."""
