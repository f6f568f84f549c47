"""The story of a model: picture -> tiles -> network -> candidates -> boxes in the picture."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.detect.detections import Detections
from pomona.detect.onnx.candidates import Selection, suppress
from pomona.detect.onnx.families import FAMILIES
from pomona.detect.onnx.mask_boxes import tightened
from pomona.detect.onnx.network import Network
from pomona.detect.onnx.preparation import prepare
from pomona.detect.onnx.signature import Signature, identify
from pomona.detect.onnx.tiles import Tile, Tiling, lay_tiles, merge_tiles, read_tiling
from pomona.detect.onnx.two_looks import ENLARGED, LARGEST_PX, LEAST, Boxes, agreed
from pomona.detect.onnx.usual_size import SHRUNK_LOOKS, SMALL_PX, shrunk_by
from pomona.errors import PomonaError
from pomona.recording import Frame

__all__ = ["IOU", "MIN_SCORE", "OnnxDetector"]

MIN_SCORE = 0.25
"""What the YOLO families use; a box that is seen once with a low score is dropped later, for want of views."""

IOU = 0.6
"""Boxes that overlap more are one fruit: then two fruits of 75 mm would hang within 19 mm across the view,
(s - d) / (s + d) = 0.6, the one nearly hidden by the other."""

CUT_PX = 3.0
"""A box that ends within so many pixels of the network's input from the edge of its tile is cut by it: as near as
detectors draw."""


@dataclass(frozen=True, eq=False)
class OnnxDetector:
    """A detector out of an ONNX file; `open` makes one."""

    network: Network
    signature: Signature
    selection: Selection
    iou: float
    class_agnostic: bool
    tiling: Tiling
    augment: bool = False

    @classmethod
    def open(
        cls,
        path: str | Path,
        *,
        family: str | None = None,
        min_score: float | None = None,
        iou: float = IOU,
        classes: tuple[str | int, ...] | None = None,
        class_agnostic: bool = True,
        tiles: str = "auto",
        size_px: tuple[int, int] | None = None,
        threads: int | None = None,
        augment: bool | None = False,
    ) -> OnnxDetector:
        """Open a model and tell what it is.

        Parameters
        ----------
        path : str or Path
            The ONNX file.
        family : str, optional
            What it is, where it does not say so itself: a key of `FAMILIES`.
        min_score : float, optional
            Least confidence of a box; else what the file asks for, else `MIN_SCORE`.
        iou : float
            Boxes that overlap more are one fruit, in families that give one fruit many times.
        classes : tuple of str or int, optional
            Names or numbers of the classes that are fruits; all where it is None.
        class_agnostic : bool
            Whether overlapping boxes of different classes are one fruit too.
        tiles : str
            `auto`: a picture that the network would see at less than half its size is cut into overlapping tiles;
            `off`; or columns x rows, as 3x2.
        size_px : (int, int), optional
            Width and height of the input, where the network takes any; else those that the file says, else 640x640.
        threads : int, optional
            For ONNX Runtime; one a core where it is None.
        augment : bool or None
            Whether each picture is looked at twice, the second time enlarged by 1.5, in three times the time: test-time
            augmentation (`two_looks`). None is yes where the network sees pictures in their own size.

        Raises
        ------
        PomonaError
            When the file cannot be run, is of no known family, or a setting is wrong.
        """
        for name, value in (("min_score", min_score), ("iou", iou)):
            if value is not None and not 0 <= value <= 1:
                raise PomonaError(f"{name}: found {value}, expected 0 to 1")
        tiling = read_tiling(tiles)
        network = Network.open(Path(path), threads)
        signature = identify(network, family, size_px)
        asked = MIN_SCORE if signature.min_score is None else signature.min_score
        selection = signature.selection(str(path), asked if min_score is None else min_score, classes)
        if augment and signature.multiple_px is None:
            found = f"{signature.family} with an input of {'x'.join(map(str, signature.size_px))}"
            raise PomonaError(
                f"{path}: augment: found {found}, expected a network that sees pictures in their own size"
            )
        twice = signature.multiple_px is not None if augment is None else augment
        return cls(network, signature, selection, iou, class_agnostic, tiling, twice)

    @property
    def path(self) -> Path:
        """The ONNX file."""
        return self.network.path

    @property
    def least_px(self) -> float | None:
        """Side of the boxes of a recording, in the median, below which it misses many; None where nobody knows."""
        return None if self.signature.multiple_px is None else SMALL_PX

    @property
    def inputs(self) -> list[Path]:
        """The file."""
        return [self.path]

    @property
    def configuration(self) -> dict[str, Any]:
        """What it runs with, for a session's provenance."""
        classes = self.selection.classes
        return {
            "model": str(self.path.resolve()),
            "family": self.signature.family,
            "size_px": list(self.signature.size_px),
            "min_score": self.selection.min_score,
            "iou": self.iou,
            "classes": None if classes is None else classes.tolist(),
            "class_agnostic": self.class_agnostic,
            "tiles": "auto" if self.tiling is None else "x".join(map(str, self.tiling)),
            "augment": self.augment,
        }

    @property
    def description(self) -> str:
        """Say in one line what the model was taken for."""
        signature = self.signature
        size = "x".join(map(str, signature.size_px)) + (" at most" if signature.multiple_px else "")
        title = f"{signature.family} ({FAMILIES[signature.family].title}) {signature.grounds}"
        looks = f"; looks twice, once enlarged by {ENLARGED:g}" if self.augment else ""
        return f"{self.path}: {title}; input {size} {signature.preparation}; {self._classes()}{looks}"

    def _classes(self) -> str:
        names, wanted = self.signature.names or {}, self.selection.classes
        chosen = list(self.signature.decoder.classes or ()) if wanted is None else wanted.tolist()
        shown = ", ".join(names.get(number, str(number)) for number in chosen[:5]) + ", ..." * (len(chosen) > 5)
        return f"fruits are of {len(chosen)} classes: {shown}" if chosen else "fruits are of all classes"

    def __call__(self, frame: Frame) -> Detections:
        """Find the fruits of one frame in its left picture.

        Raises
        ------
        PomonaError
            When it has none; an `UnreadablePictureError` when it cannot be read.
        """
        if frame.read_left is None:
            raise PomonaError(f"frame {frame.number}: found no left picture, expected one: {self.path} needs it")
        return self.detect(frame.read_left())

    def detect(self, picture: NDArray[np.uint8]) -> Detections:
        """Find the fruits of a picture.

        Parameters
        ----------
        picture : (H, W, 3) uint8
            BGR.

        Returns
        -------
        Detections
            Without ids, best first; boxes end at the edge of the picture.

        Raises
        ------
        PomonaError
            When it is anything else than such an array, or an empty one.
        """
        _require_picture(picture)
        picture_px = (picture.shape[1], picture.shape[0])
        tiles = lay_tiles(picture_px, self.signature.size_px, self.tiling)
        found = [self._in_tile(picture, tile) for tile in tiles]
        boxes_px, scores = (np.concatenate(parts) for parts in zip(*found, strict=True))
        if len(tiles) > 1:
            seen = np.repeat([tile.corners_px for tile in tiles], [len(part) for _, part in found], axis=0).astype(
                float
            )
            boxes_px, scores = merge_tiles(boxes_px, scores, seen, picture_px, self._margin_px(tiles[0]))
        return _within(boxes_px, scores, picture_px)

    def _in_tile(self, picture: NDArray[np.uint8], tile: Tile) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Boxes and scores of one tile, in the pixels of the picture."""
        part = picture[tile.ymin : tile.ymax, tile.xmin : tile.xmax]
        boxes_px, scores = self._two_looks(part) if self.augment else self._look(part, self.selection)
        return boxes_px + np.tile((tile.xmin, tile.ymin), 2), scores

    def _two_looks(self, picture: NDArray[np.uint8]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        asked = self.selection
        least = replace(asked, min_score=LEAST)
        first, enlarged = self._in_usual_size(picture, least)
        second = self._look(picture, least, ENLARGED * enlarged)
        largest_px = LARGEST_PX / (enlarged * self.signature.ratio((picture.shape[1], picture.shape[0])))
        with np.errstate(all="ignore"):
            return agreed(first, second, self.iou, largest_px, asked.min_score)

    def _in_usual_size(self, picture: NDArray[np.uint8], selection: Selection) -> tuple[Boxes, float]:
        """Look at a picture shrunk until its fruits are as large as those that are learnt from; and how it is seen."""
        ratio = self.signature.ratio((picture.shape[1], picture.shape[0]))
        found, enlarged = self._look(picture, selection), 1.0
        for _ in range(SHRUNK_LOOKS):
            by = shrunk_by(found, ratio * enlarged, self.signature.usual_px)
            if by == 1.0:
                break
            enlarged *= by
            found = self._look(picture, selection, enlarged)
        return found, enlarged

    def _look(
        self, picture: NDArray[np.uint8], selection: Selection, enlarged: float = 1.0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Boxes and scores that the network tells of a picture that it sees enlarged."""
        size_px = self.signature.input_px((picture.shape[1], picture.shape[0]), enlarged)
        given, placement = prepare(picture, size_px, self.signature.preparation, enlarged)
        outputs = self.network.run(given)
        # A network may give NaN and infinity; boxes of such numbers are left out at the end.
        with np.errstate(all="ignore"):
            candidates = self.signature.decoder(outputs, selection)
            if FAMILIES[self.signature.family].overlapping:
                candidates = suppress(candidates, self.iou, across_classes=self.class_agnostic)
            return placement.to_picture(tightened(candidates, size_px)), candidates.scores

    def _margin_px(self, tile: Tile) -> float:
        width, height = self.signature.input_px((tile.xmax - tile.xmin, tile.ymax - tile.ymin))
        return CUT_PX * max((tile.xmax - tile.xmin) / width, (tile.ymax - tile.ymin) / height)


def _require_picture(picture: object) -> None:
    """Refuse other numbers and other axes, of which a network makes boxes all the same."""
    expected = "expected a picture, (H, W, 3) uint8 in the order BGR"
    if not isinstance(picture, np.ndarray):
        raise PomonaError(f"picture: found {type(picture).__name__}, {expected}")
    if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[2] != 3 or picture.size == 0:
        raise PomonaError(f"picture: found {picture.shape} {picture.dtype}, {expected}")


def _within(boxes_px: NDArray[np.float64], scores: NDArray[np.float64], picture_px: tuple[int, int]) -> Detections:
    """Cut boxes at the picture's edge; without what is outside or no box (a network may give NaN)."""
    cut_px = np.clip(boxes_px, 0, np.tile(picture_px, 2))
    rows = np.argsort(-scores, kind="stable")
    rows = rows[
        ~np.isnan(scores[rows])
        & np.isfinite(boxes_px[rows]).all(axis=1)
        & (cut_px[rows, :2] < cut_px[rows, 2:]).all(axis=1)
    ]
    return Detections(cut_px[rows], np.clip(scores[rows], 0, 1))
