"""Masks by brightness and colour, for subjects lit so that these alone tell them from all else: a white mouse under
infrared light, a dark fly on a lit plate, a glove of one colour.
"""

import cv2
import numpy as np

from studio.evidence.settings import EvidenceSettings
from studio.foundations.arrays import Bytes

HALF_TURN = 180.0


def between_thresholds(picture: Bytes, settings: EvidenceSettings) -> Bytes:
    """(H, W) uint8, 255 where a picture (H, W, 3) BGR is as bright and of such a colour as the knobs say.

    Brightness is the mean of the three colours, smoothed over 3 pixels as the colours are, so that noise makes no
    holes; hue (degrees) and saturation (0 to 1) are those of HSV.
    """
    smooth = np.asarray(cv2.blur(picture, (3, 3)), np.uint8)
    low, high = settings.mask_darkest, settings.mask_brightest
    level = np.asarray(cv2.transform(smooth, np.full((1, 3), 1.0 / 3.0, np.float32)), np.uint8)
    inside = (level >= low) & (level <= high)
    any_hue = settings.mask_hue_reach >= HALF_TURN
    if settings.mask_saturation > 0.0 or not any_hue:
        # OpenCV's hue is in steps of two degrees.
        hue, saturation = np.asarray(cv2.cvtColor(smooth, cv2.COLOR_BGR2HSV))[..., :2].transpose(2, 0, 1)
        inside &= saturation >= 255.0 * settings.mask_saturation
        if not any_hue:
            away = (2.0 * hue.astype(np.float32) - settings.mask_hue + HALF_TURN) % 360.0 - HALF_TURN
            inside &= np.abs(away) <= settings.mask_hue_reach
    return np.where(inside, np.uint8(255), np.uint8(0))
