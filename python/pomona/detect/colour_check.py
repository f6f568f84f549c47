"""Whether pictures have the colours that the detector inside looks for."""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Sequence
from itertools import islice

import numpy as np
from numpy.typing import NDArray

from pomona.amounts import amount
from pomona.errors import PomonaWarning
from pomona.recording import Recording
from pomona.recording.pictures import UnreadablePictureError

__all__ = ["check_colour", "colour_amiss", "tell_amiss"]

NO_COLOUR, EXCHANGED = "no colour", "red and blue exchanged"

LOOKED_AT = 5
"""Frames from the first on, of which one must be readable."""

GREY_STEPS = 12
"""Steps of 255 by which the channels of a grey picture may differ: H.264 leaves up to 6. The dullest of 437 photographs
and rendered pictures of fruit trees in colour has pixels that differ by 90."""


STEP_PX = 4
"""Of the pixels whose colour is asked, each way."""

LEAST_GREEN, SOME_GREEN = 1.05, 0.1
"""Times the other channels, that green has in a leaf, and the share of such pixels from which on they tell."""

LEAST_RED = -0.1
"""Median of red less blue in these, of green. Leaves have more red than blue: it is 0 or more in each of 326
photographs and rendered pictures, .02 to .27 in the median of six sets, and -.23 where the channels of one were
exchanged."""


def colour_amiss(picture: NDArray[np.uint8]) -> str | None:
    """Say what is wrong with the colours of a picture, (H, W, 3) uint8, BGR; None where nothing is."""
    if int(np.ptp(picture.astype(np.int16), axis=2).max()) <= GREY_STEPS:
        return NO_COLOUR
    blue, green, red = np.moveaxis(picture[::STEP_PX, ::STEP_PX].astype(np.float32), 2, 0)
    is_leaf = (green > LEAST_GREEN * red) & (green > LEAST_GREEN * blue)
    if is_leaf.mean() < SOME_GREEN:
        return None
    more_red = float(np.median((red - blue)[is_leaf] / green[is_leaf]))
    return EXCHANGED if more_red < LEAST_RED else None


def check_colour(recording: Recording) -> None:
    """Warn where the colours of the first picture are amiss: the detector that is inside then finds few fruits."""
    for frame in islice(recording.frames(), LOOKED_AT):
        try:
            picture = frame.read_left() if frame.read_left is not None else None
        except UnreadablePictureError:
            continue
        if picture is not None and (amiss := colour_amiss(picture)) is not None:
            advice = "give --model or --detections of your own" if amiss == NO_COLOUR else "bring them back"
            found = f"the pictures have {amiss}, and the detector that is inside finds few fruits so"
            warnings.warn(f"{recording.path}: {found}: {advice}", PomonaWarning, stacklevel=3)
        return


def tell_amiss(found: Sequence[str]) -> None:
    """Warn of pictures whose colours are amiss, each with what `colour_amiss` says of it."""
    for amiss, count in Counter(found).items():
        has = "has" if count == 1 else "have"
        message = f"{amount(count, 'picture')} {has} {amiss}, and the detector that is inside finds few fruits there"
        warnings.warn(message, PomonaWarning, stacklevel=3)
