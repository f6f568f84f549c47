"""To and from `supervision.Detections` (https://supervision.roboflow.com), which is imported only here.

Both sides keep boxes as xmin, ymin, xmax, ymax from the top left corner of the top left pixel.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pomona.detect.detections import Detections
from pomona.errors import PomonaError

__all__ = ["from_supervision", "to_supervision"]

ID_FIELD = "id"
"""Key in `supervision.Detections.data` of names that are no numbers."""


def from_supervision(detections: Any, *, classes: tuple[int, ...] | None = None) -> Detections:
    """Take boxes over from supervision.

    Parameters
    ----------
    detections : supervision.Detections
        Its `xyxy`, `confidence` (1 where it is None) and `tracker_id` (the ids, where it is not None) are used, or the
        names in `data["id"]` that `to_supervision` put there.
    classes : tuple of int, optional
        Classes of `class_id` to keep; all where it is None.
    """
    boxes_px = np.asarray(detections.xyxy, np.float64).reshape(-1, 4)
    scores = np.ones(len(boxes_px)) if detections.confidence is None else np.asarray(detections.confidence, np.float64)
    names = getattr(detections, "data", {}).get(ID_FIELD, detections.tracker_id)
    kept = np.ones(len(boxes_px), bool)
    if classes is not None:
        if detections.class_id is None:
            raise PomonaError("supervision.Detections: class_id: found None, expected a class for each box")
        kept = np.isin(detections.class_id, classes)
    ids = None if names is None else tuple(str(name) for name in np.asarray(names)[kept])
    return Detections(boxes_px[kept], scores[kept], ids)


def to_supervision(detections: Detections) -> Any:
    """Hand boxes to supervision: one class (0), ids in `data["id"]`, and as `tracker_id` where all are whole numbers.

    Raises
    ------
    PomonaError
        When supervision is not installed.
    """
    try:
        import supervision
    except ImportError:
        raise PomonaError("supervision: not installed, expected it here: pip install supervision") from None
    ids = detections.ids
    numeric = ids is not None and all(name.isascii() and name.isdecimal() for name in ids)
    return supervision.Detections(
        xyxy=detections.boxes_px.astype(np.float32),
        confidence=detections.scores.astype(np.float32),
        class_id=np.zeros(len(detections), int),
        tracker_id=np.array(ids, int) if numeric and ids else None,
        data={} if ids is None else {ID_FIELD: np.array(ids, str)},
    )
