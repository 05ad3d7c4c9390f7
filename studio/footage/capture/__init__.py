"""Cameras solved and footage read: calibration files, videos, picture folders."""
