"""Outputs of the transformers that choose their boxes themselves: RT-DETR and its relatives, RF-DETR."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pomona.detect.onnx.candidates import Candidates, Selection, from_centres, select
from pomona.detect.onnx.network import Outputs

__all__ = ["ChosenDecoder", "LogitDecoder", "NormalisedDecoder"]


@dataclass(frozen=True)
class ChosenDecoder:
    """Reads `labels`, `boxes` (corners, scaled to `orig_target_sizes`) and `scores`: RT-DETR, D-FINE, DEIM."""

    classes: Sequence[int] | None = None

    def __call__(self, outputs: Outputs, selection: Selection) -> Candidates:
        """Give the candidates of one picture."""
        scores, classes = outputs["scores"].astype(np.float64), outputs["labels"].astype(np.int64)
        wanted = np.ones(len(scores), bool) if selection.classes is None else np.isin(classes, selection.classes)
        rows = np.flatnonzero(wanted & (scores >= selection.min_score))
        return Candidates(outputs["boxes"][rows].astype(np.float64), scores[rows], classes[rows], rows)


@dataclass(frozen=True)
class NormalisedDecoder:
    """Reads centre and size as parts of the input, then a score for each class: RT-DETR as Ultralytics exports it."""

    boxes: str
    size_px: tuple[int, int]
    n_classes: int

    @property
    def classes(self) -> Sequence[int]:
        """Numbers of the classes."""
        return range(self.n_classes)

    def __call__(self, outputs: Outputs, selection: Selection) -> Candidates:
        """Give the candidates of one picture."""
        head = outputs[self.boxes]
        rows, scores, classes = select(head[:, 4:].astype(np.float64), selection)
        return Candidates(from_centres(head[rows, :4]) * np.tile(self.size_px, 2), scores, classes, rows)


@dataclass(frozen=True)
class LogitDecoder:
    """Reads boxes (centre and size as parts of the input), a logit for each class, and masks of logits: RF-DETR.

    Attributes
    ----------
    boxes, logits, masks : str, str, str or None
        Names of the outputs.
    size_px : (int, int)
        Width and height of the input.
    classes : sequence of int
        Those of the logits that stand for things and not for none.
    """

    boxes: str
    logits: str
    masks: str | None
    size_px: tuple[int, int]
    classes: Sequence[int]

    def __call__(self, outputs: Outputs, selection: Selection) -> Candidates:
        """Give the candidates of one picture."""
        # Each class has a probability of its own: sigmoid, not softmax. Beyond 60 float64 has no more to say.
        probabilities = 1 / (1 + np.exp(-np.clip(outputs[self.logits].astype(np.float64), -60, 60)))
        classes = np.array(self.classes if selection.classes is None else selection.classes, np.int64)
        rows, scores, best = select(probabilities, Selection(selection.min_score, classes))
        boxes_px = from_centres(outputs[self.boxes][rows]) * np.tile(self.size_px, 2)
        masks = None if self.masks is None else outputs[self.masks]
        return Candidates(boxes_px, scores, best, rows, None if masks is None else lambda row: masks[row])
