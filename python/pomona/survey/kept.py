"""What single frames showed, kept in a folder: a scan that is started again need not look twice.

Detector and depth see each frame by itself, so what they found is taken up frame by frame; poses and tracks need all
frames and are found anew. The fruits are the same, kept or not.
"""

from __future__ import annotations

import json
import zipfile
import zlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from pomona.atomic import whole_file
from pomona.detect import Detections
from pomona.errors import PomonaError
from pomona.made_from import note_made_from
from pomona.reading import require_file
from pomona.recording import Frame
from pomona.survey.depth import Lifted, Refusal
from pomona.survey.seeing import Look

__all__ = ["Kept"]

FORMAT = 4

APPEARANCE = ("colours", "fruitness", "fruit_px", "elsewhere")

MOST_BYTES = 1 << 28
"""256 MiB unpacked: a frame of ten thousand boxes is 4 MB."""

MOST_REASON = 100
"""Characters of what a library says that a message repeats."""

UNREADABLE = (
    *(OSError, EOFError, zipfile.BadZipFile, zlib.error, RuntimeError),  # of the archive
    *(KeyError, ValueError, TypeError, AttributeError, MemoryError, PomonaError),  # of what is in it
)

LIFTED = ("rows", "centres_in_camera", "covariances", "diameters_m", "diameter_sigmas_m", "hidden", "support")


class Kept:
    """A folder of looks, one file a frame, made from one recording with one set of settings.

    Parameters
    ----------
    folder : Path
        Made where it is not there.
    made_from : mapping
        Whatever the looks depend on, JSON values.

    Raises
    ------
    PomonaError
        When the folder keeps what was made from something else, or cannot be written.
    """

    def __init__(self, folder: Path, made_from: Mapping[str, Any]) -> None:
        self._looks = folder / "looks"
        note_made_from(folder, {"format": FORMAT, **made_from})
        try:
            self._looks.mkdir(exist_ok=True)
        except OSError as error:
            raise PomonaError(f"{folder}: cannot be written: {error.strerror}") from None

    def remembering(self, see: Callable[[Frame], Look]) -> Callable[[Frame], Look]:
        """Give a `see` that looks only at frames that are not kept yet, and keeps them."""

        def look(frame: Frame) -> Look:
            file = self._looks / f"{frame.number:06d}.npz"
            if file.is_file():
                return _read(file, frame.number)
            seen = see(frame)
            if seen.unusable is None:
                _write(file, seen)
            return seen

        return look


def _write(file: Path, look: Look) -> None:
    arrays: dict[str, Any] = {name: getattr(look.lifted, name) for name in LIFTED}
    arrays |= {"boxes_px": look.detections.boxes_px, "scores": look.detections.scores}
    arrays["looked"] = np.array(look.detections.looked)
    arrays["refused"] = np.array(json.dumps({row: reason.name for row, reason in look.lifted.refused.items()}))
    if look.detections.ids is not None:
        arrays["ids"] = np.array(json.dumps(look.detections.ids))
    arrays |= {name: values for name in APPEARANCE if (values := getattr(look, name)) is not None}
    with whole_file(file) as partial, partial.open("wb") as stream:
        np.savez(stream, **arrays)


def _require_bounded(file: Path) -> None:
    with zipfile.ZipFile(file) as archive:
        if sum(member.file_size for member in archive.infolist()) > MOST_BYTES:
            raise ValueError(f"more than {MOST_BYTES >> 20} MiB unpacked")


def _read(file: Path, frame: int) -> Look:
    try:
        require_file(file, "a kept frame")
        _require_bounded(file)
        with file.open("rb") as stream, np.load(stream, allow_pickle=False) as arrays:
            ids = tuple(json.loads(str(arrays["ids"]))) if "ids" in arrays else None
            refused = json.loads(str(arrays["refused"]))
            return Look(
                frame,
                Detections(arrays["boxes_px"], arrays["scores"], ids, bool(arrays["looked"])),
                Lifted(
                    **{name: arrays[name] for name in LIFTED},
                    refused=_refused(refused, len(arrays["boxes_px"])),
                ),
                **{name: arrays.get(name) for name in APPEARANCE},
            )
    except UNREADABLE as error:
        raise PomonaError(f"{file}: not a kept frame ({str(error)[:MOST_REASON]}): remove it") from None


def _refused(found: object, n_boxes: int) -> dict[int, Refusal]:
    if not isinstance(found, dict):
        raise ValueError("refused is no object")
    refused = {int(row): Refusal[name] for row, name in found.items()}
    if not refused.keys() <= set(range(n_boxes)):
        raise ValueError("refused names a box that is not there")
    return refused
