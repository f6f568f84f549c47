"""The families of detectors: what each expects of a picture, and how its outputs are recognised and read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from pomona.detect.onnx.candidates import Candidates, Selection
from pomona.detect.onnx.centres import CHANNELS, CentreDecoder
from pomona.detect.onnx.claims import Claim
from pomona.detect.onnx.detr import ChosenDecoder, LogitDecoder, NormalisedDecoder
from pomona.detect.onnx.network import Outputs
from pomona.detect.onnx.preparation import Preparation
from pomona.detect.onnx.yolo import DenseDecoder, EndToEndDecoder, box_output, cells_of, grid, prototype_output

__all__ = ["FAMILIES", "Decoder", "Family", "Layout"]

IMAGENET_MEAN = (0.485, 0.456, 0.406)
IMAGENET_STD = (0.229, 0.224, 0.225)
FRUITS = "fruits"
"""Output of our own network."""

COCO_SLOTS = 91
"""Logits of models trained on COCO's own numbers of categories, where the last stands for a thing."""


class Decoder(Protocol):
    """Reads the outputs for one picture."""

    @property
    def classes(self) -> Sequence[int] | None:
        """Numbers of the classes that it can tell, None where only the outputs for a picture say so."""

    def __call__(self, outputs: Outputs, selection: Selection) -> Candidates:
        """Give the candidates that the selection wants."""


@dataclass(frozen=True)
class Layout:
    """What is known of a network.

    Attributes
    ----------
    outputs : mapping
        Those for an empty picture.
    size_px : (int, int)
        Width and height of the input.
    takes_sizes : bool
        Whether `orig_target_sizes` is an input.
    claim : Claim
        What the file says.
    named : bool
        Whether the file or the user names the family, so that the outputs need not.
    """

    outputs: Outputs
    size_px: tuple[int, int]
    takes_sizes: bool
    claim: Claim
    named: bool

    @property
    def n_names(self) -> int | None:
        """Classes that the file names."""
        return None if self.claim.names is None else len(self.claim.names)

    @property
    def classes(self) -> Sequence[int] | None:
        """Their numbers."""
        return None if self.claim.names is None else tuple(sorted(self.claim.names))


@dataclass(frozen=True)
class Family:
    """One family.

    Attributes
    ----------
    title : str
        The models in it.
    signature : str
        Its outputs, for messages.
    preparation : Preparation
        What it expects of a picture.
    overlapping : bool
        Whether it gives one thing many times, so that overlapping boxes must be suppressed.
    decoder : callable
        Gives the decoder for a layout, None where the layout is another.
    multiple_px : int or None
        A network that takes any size is given the picture as it is, its sides filled up to multiples of this; None
        where it wants the size that it was trained at.
    """

    title: str
    signature: str
    preparation: Preparation
    overlapping: bool
    decoder: Callable[[Layout], Decoder | None]
    multiple_px: int | None = None


def _dense(layout: Layout, per_cell: int, *, objectness: bool, transposed: bool) -> DenseDecoder | None:
    """Recognise a head of 4 numbers, objectness, classes and coefficients for each cell of the grids."""
    name, prototypes = box_output(layout.outputs), prototype_output(layout.outputs)
    if name is None:
        return None
    rows, columns = layout.outputs[name].shape[:: -1 if transposed else 1]
    n_masks = 0 if prototypes is None else len(layout.outputs[prototypes])
    n_classes = columns - 4 - objectness - n_masks
    # One class makes rows of YOLOv5 as long as those of chosen boxes: the count of cells tells them apart.
    counted = layout.named or rows in {per_cell * cells for cells in cells_of(layout.size_px)}
    if not counted or n_classes < 1 or layout.n_names not in (None, n_classes):
        return None
    return DenseDecoder(name, prototypes, n_classes, objectness, transposed)


def _yolov5(layout: Layout) -> Decoder | None:
    return _dense(layout, 3, objectness=True, transposed=False)  # three anchors a cell


def _yolov8(layout: Layout) -> Decoder | None:
    return _dense(layout, 1, objectness=False, transposed=True)


def _yolox(layout: Layout) -> Decoder | None:
    """Recognise YOLOX; whether its export decoded the grid is told by the centres for an empty picture.

    Relative to their cells all centres lie within a few cells of 0; decoded they are spread over the whole picture.
    """
    head = _dense(layout, 1, objectness=True, transposed=False)
    strides = None if head is None else cells_of(layout.size_px).get(len(layout.outputs[head.boxes]))
    if head is None or strides is None:
        return None
    corners, sizes = grid(layout.size_px, strides)
    centres = layout.outputs[head.boxes][:, :2]
    decoded_px = (corners + 0.5) * sizes
    if np.median(np.abs(centres - decoded_px)) < np.median(np.abs(centres)):
        return head
    return DenseDecoder(head.boxes, None, head.n_classes, True, False, (corners, sizes))


def _end_to_end(layout: Layout) -> Decoder | None:
    name, prototypes = box_output(layout.outputs), prototype_output(layout.outputs)
    n_masks = 0 if prototypes is None else len(layout.outputs[prototypes])
    if name is None or layout.outputs[name].shape[1] != 6 + n_masks:
        return None
    return EndToEndDecoder(name, prototypes, layout.classes)


def _rtdetr(layout: Layout) -> Decoder | None:
    named = layout.takes_sizes and {"labels", "boxes", "scores"} <= layout.outputs.keys()
    return ChosenDecoder(layout.classes) if named else None


def _rtdetr_ultralytics(layout: Layout) -> Decoder | None:
    name = box_output(layout.outputs)
    if name is None or layout.n_names is None or layout.outputs[name].shape[1] != 4 + layout.n_names:
        return None
    return NormalisedDecoder(name, layout.size_px, layout.n_names)


def _rfdetr(layout: Layout) -> Decoder | None:
    """Recognise RF-DETR by the names of its outputs: with three classes boxes and logits have the same shape."""
    roles, outputs = layout.claim.outputs, layout.outputs
    boxes, logits = roles.get("pred_boxes", "dets"), roles.get("pred_logits", "labels")
    if not {boxes, logits} <= outputs.keys() or outputs[boxes].ndim != 2 or outputs[boxes].shape[1] != 4:
        return None
    # The first exports of masks left their output without a name of its own.
    others = [name for name in outputs if name not in (boxes, logits) and outputs[name].ndim == 3]
    masks = roles.get("pred_masks", others[0] if len(others) == 1 else None)
    slots = outputs[logits].shape[1]
    if layout.claim.names is not None:
        classes = tuple(number for number in sorted(layout.claim.names) if number < slots)
    else:  # numbers counted from 0 leave a last slot that stands for nothing
        classes = tuple(range(slots if slots in (1, COCO_SLOTS) else slots - 1))
    return LogitDecoder(boxes, logits, masks if masks in outputs else None, layout.size_px, classes)


def _pomona(layout: Layout) -> Decoder | None:
    found = layout.outputs.get(FRUITS)
    if found is None or found.ndim != 3 or len(found) != CHANNELS or layout.size_px[1] % found.shape[1]:
        return None
    stride = layout.size_px[1] // found.shape[1]
    return CentreDecoder(FRUITS, stride) if found.shape[2] * stride == layout.size_px[0] else None


_RTDETR = Preparation(fit="stretch", resize="smooth")
_RFDETR = Preparation(fit="stretch", resize="float", mean=IMAGENET_MEAN, std=IMAGENET_STD)
_YOLOX = Preparation(fit="corner", channels="BGR", divide_by=1.0)

FAMILIES = {
    "pomona": Family(
        "our own", "fruits (6, cells)", Preparation(fit="inside"), overlapping=True, decoder=_pomona, multiple_px=32
    ),
    "rfdetr": Family("RF-DETR", "dets (N, 4), labels (N, slots)[, masks]", _RFDETR, False, _rfdetr),
    "rtdetr": Family(
        "RT-DETR, D-FINE, DEIM", "labels, boxes, scores, and an input orig_target_sizes", _RTDETR, False, _rtdetr
    ),
    "yolov8": Family("YOLOv8, v9, 11, 12", "output0 (4 + classes, cells)[, output1]", Preparation(), True, _yolov8),
    "yolov5": Family("YOLOv5, v7", "output0 (3 cells, 5 + classes)[, output1]", Preparation(), True, _yolov5),
    "yolox": Family("YOLOX", "output (cells, 5 + classes)", _YOLOX, True, _yolox),
    "yolo-end2end": Family(
        "YOLO26, YOLOv10, exports with nms", "output0 (N, 6)[, output1]", Preparation(), False, _end_to_end
    ),
    "rtdetr-ultralytics": Family(
        "RT-DETR by Ultralytics", "output0 (N, 4 + classes)", Preparation(fit="stretch"), False, _rtdetr_ultralytics
    ),
}
"""In the order in which they are tried on a file that does not say what it is: the most telling names first."""
