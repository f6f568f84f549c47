"""Which family a network belongs to, and on what grounds.

In this order: what the user says, our own metadata, RF-DETR's, Ultralytics', the names and shapes of the outputs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from pomona.detect.onnx.candidates import Selection
from pomona.detect.onnx.claims import claim_of
from pomona.detect.onnx.families import FAMILIES, Decoder, Family, Layout
from pomona.detect.onnx.network import Network, Outputs
from pomona.detect.onnx.preparation import PADDING, Preparation, prepare
from pomona.errors import PomonaError
from pomona.reading import shown
from pomona.recording.picture_size import require_size

__all__ = ["ALIASES", "Signature", "identify"]

ALIASES = {
    "yolov7": "yolov5",
    "yolov9": "yolov8",
    "yolo11": "yolov8",
    "yolo12": "yolov8",
    "yolov10": "yolo-end2end",
    "yolo26": "yolo-end2end",
    "d-fine": "rtdetr",
    "deim": "rtdetr",
}
"""Other names for the families."""

DEFAULT_SIDE_PX = 640
"""Input of a network that takes any size and does not say what it was trained at: what most are trained at."""

LARGEST_SIDE_PX = 1280
"""Of a picture that is taken as it is; larger ones are shrunk, or cut in tiles: 0.1 s of one core."""


@dataclass(frozen=True)
class Signature:
    """How a network is used.

    Attributes
    ----------
    family : str
        Key of `FAMILIES`.
    grounds : str
        What told it, for people.
    decoder : Decoder
        Reads its outputs.
    preparation : Preparation
        What it expects of a picture.
    names : mapping or None
        Names of its classes by number.
    size_px : (int, int)
        Width and height of its input; where any goes, those to use, or with `multiple_px` the largest.
    multiple_px : int or None
        Where the input is as large as the picture: sides are multiples of this.
    min_score : float or None
        Least confidence that the file asks for.
    usual_px : float or None
        Side of the fruits that it has learnt from, where the file says so.
    """

    family: str
    grounds: str
    decoder: Decoder
    preparation: Preparation
    names: dict[int, str] | None
    size_px: tuple[int, int]
    multiple_px: int | None = None
    min_score: float | None = None
    usual_px: float | None = None

    def input_px(self, picture_px: tuple[int, int], enlarged: float = 1.0) -> tuple[int, int]:
        """Width and height of the input for a picture of such a size, `enlarged` where any size goes."""
        if self.multiple_px is None:
            return self.size_px
        ratio = enlarged * self.ratio(picture_px)
        width, height = (
            self.multiple_px * math.ceil(max(int(side * ratio), 1) / self.multiple_px) for side in picture_px
        )
        return width, height

    def ratio(self, picture_px: tuple[int, int]) -> float:
        """By how much a picture is shrunk so that it fits, where any size goes; 1 where it does as it is."""
        return min(1.0, self.size_px[0] / picture_px[0], self.size_px[1] / picture_px[1])

    def selection(self, where: str, min_score: float, classes: tuple[str | int, ...] | None) -> Selection:
        """Turn names or numbers of classes into a selection.

        Raises
        ------
        PomonaError
            When there is no such class.
        """
        if classes is None:
            return Selection(min_score)
        numbers = {name: number for number, name in (self.names or {}).items()}
        known = self.decoder.classes
        chosen = []
        for wanted in classes:
            number = numbers.get(str(wanted), int(wanted) if str(wanted).isdecimal() else -1)
            if number < 0 or (known is not None and number not in known):
                expected = ", ".join(map(str, numbers or known or ())) or "a number"
                raise PomonaError(f"{where}: class: found {wanted!r}, expected {expected[:200]}")
            chosen.append(number)
        return Selection(min_score, np.unique(np.array(chosen, np.int64)))


def identify(network: Network, family: str | None = None, size_px: tuple[int, int] | None = None) -> Signature:
    """Tell the family of a network.

    Parameters
    ----------
    network : Network
        It is run once, on an empty picture.
    family : str, optional
        What the user says it is: a key of `FAMILIES` or `ALIASES`.
    size_px : (int, int), optional
        Width and height to use, where the network takes any size.

    Raises
    ------
    PomonaError
        When it is of no known family: what was found and what is accepted.
    """
    claim, wanted_px = claim_of(network.path, network.metadata), size_px
    asked = family or claim.family
    key = None if asked is None else _known(network, asked, claim.source if family is None else "the setting")
    size_px = _size(network, size_px or claim.size_px)
    # A network in the wrong clothes runs as well: only the shapes of what comes out count here, not what it finds.
    layout = Layout(_outputs_for_nothing(network, size_px), size_px, network.takes_sizes, claim, asked is not None)
    for name, candidate in FAMILIES.items():
        decoder = candidate.decoder(layout) if key in (None, name) else None
        if decoder is not None:
            changed = {} if family else claim.preparation
            free = network.size_px is None and wanted_px is None and candidate.multiple_px is not None
            return Signature(
                family=name,
                grounds="as was said" if family else f"by {claim.source}",
                decoder=decoder,
                preparation=replace(candidate.preparation, **changed),
                names=claim.names,
                size_px=(LARGEST_SIDE_PX, LARGEST_SIDE_PX) if free else size_px,
                multiple_px=candidate.multiple_px if free else None,
                min_score=claim.min_score,
                usual_px=claim.usual_px,
            )
    raise PomonaError(_unknown(network, layout, None if key is None else (key, FAMILIES[key])))


def _known(network: Network, name: str, source: str) -> str:
    key = ALIASES.get(name.lower(), name.lower())
    if key not in FAMILIES:
        expected = ", ".join([*FAMILIES, *ALIASES])
        raise PomonaError(f"{network.path}: family: found {shown(name)} in {source}, expected one of {expected}")
    return key


def _size(network: Network, wanted_px: tuple[int, int] | None) -> tuple[int, int]:
    if network.size_px is None:
        return require_size(f"{network.path}: input", wanted_px or (DEFAULT_SIDE_PX, DEFAULT_SIDE_PX))
    return network.size_px


def _outputs_for_nothing(network: Network, size_px: tuple[int, int]) -> Outputs:
    grey = np.full((size_px[1], size_px[0], 3), PADDING, np.uint8)
    return network.run(prepare(grey, size_px, Preparation())[0])


def _unknown(network: Network, layout: Layout, asked: tuple[str, Family] | None) -> str:
    found = ", ".join(f"{name} {output.shape}" for name, output in layout.outputs.items())
    if asked is not None:
        return f"{network.path}: outputs: found {found}, expected those of {asked[0]}: {asked[1].signature}"
    accepted = "; ".join(f"{key} ({family.signature})" for key, family in FAMILIES.items())
    return f"{network.path}: outputs: found {found}, expected those of a family: {accepted}"
