"""Footage and its cameras: reading it, and where the cameras stand.

Which pictures belong together is decided by number or by time (`capture/frame_pairing.py`; a camera's source keeps
it); interlaced videos become fields (`capture/interlacing.py`). Up is found in `calibration/vertical.py`. Native
parsers meet unchecked files in a process of their own (`foundations/isolated.py`).
"""
