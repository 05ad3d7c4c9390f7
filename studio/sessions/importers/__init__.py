"""Footage and calibration of others' making, turned into sessions."""
