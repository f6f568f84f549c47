"""Letters and colours for fruits drawn on pictures."""

from __future__ import annotations

import colorsys

import numpy as np
from numpy.typing import NDArray

__all__ = ["colour_of", "lettering", "write_on"]

Picture = NDArray[np.uint8]
Colour = tuple[int, int, int]

GOLDEN = 0.618034
"""Step of the hue from one fruit to the next: neighbours in number never look alike."""

LETTERS_FIT_PX, LEAST_LETTERING = 600, 0.9
"""Height of the picture for which letters are 9 px high; they grow with it, and below stay what the font can show."""


def lettering(height_px: int) -> float:
    """Size of letters and lines: on a screen a picture is seen as high as the screen, whatever its pixels."""
    return max(height_px / LETTERS_FIT_PX, LEAST_LETTERING)


def write_on(picture: Picture, place: tuple[float, float], text: str, colour: Colour, size: float) -> None:
    """Write with a dark rim, legible on leaves and sky."""
    import cv2

    x, y, rim = round(float(place[0])), round(float(place[1])), max(1, round(size))
    # Thicker letters are also wider, so the rim is the same letters moved.
    around = [(x + right, y + down) for right in (-rim, 0, rim) for down in (-rim, 0, rim)]
    for at, ink in (*((each, (0, 0, 0)) for each in around), ((x, y), colour)):
        cv2.putText(picture, text, at, cv2.FONT_HERSHEY_SIMPLEX, 0.38 * size, ink, rim, cv2.LINE_AA)


def colour_of(fruit: int) -> Colour:
    """Give each number a colour of its own, BGR."""
    red, green, blue = colorsys.hsv_to_rgb(fruit * GOLDEN % 1.0, 0.55, 1.0)
    return int(255 * blue), int(255 * green), int(255 * red)
