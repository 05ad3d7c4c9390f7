"""Pictures made ready for the look of limbs (`search.likelihood.limb_looks`)."""

import cv2
import numpy as np

from studio.evidence.edges import grey
from studio.foundations.arrays import Bytes, Floats

SMOOTHING, NEARBY = 1.5, 12.0
"""Pixels: Gaussians that smooth the picture, and by which the usual slope near a pixel is measured."""
FAINT = 1.0
"""Grey levels per pixel: slopes below are noise."""


def look_maps(picture: Bytes) -> Floats:
    """(3, H, W) of a picture (H, W, 3) BGR: smoothed grey levels, slopes in x and y as shares of the usual nearby."""
    level = grey(picture).astype(np.float32)
    smooth = np.asarray(cv2.GaussianBlur(level, (0, 0), SMOOTHING))
    x = np.asarray(cv2.Sobel(smooth, cv2.CV_32F, 1, 0, ksize=3)) / 8.0
    y = np.asarray(cv2.Sobel(smooth, cv2.CV_32F, 0, 1, ksize=3)) / 8.0
    power = (x * x + y * y).astype(np.float32)
    usual = np.sqrt(np.asarray(cv2.GaussianBlur(power, (0, 0), NEARBY)) + FAINT**2)
    return np.ascontiguousarray(np.stack([smooth, x / usual, y / usual]), dtype=np.float32)
