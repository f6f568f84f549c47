"""A model in eight bits: half the time on processors that multiply bytes."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import onnx
from numpy.typing import NDArray

from pomona.atomic import whole_file
from pomona.detect.training.graph import LAST

__all__ = ["write_eight_bits"]


def write_eight_bits(path: Path, model: Path, pictures: Iterable[NDArray[np.float32]]) -> None:
    """Write a model with its convolutions in eight bits, all but the last: its logits and sizes need more.

    Parameters
    ----------
    path : Path
        The ONNX file.
    model : Path
        In 32 bits.
    pictures : iterable of (1, 3, H, W) float32
        Prepared for the network: they show how large the numbers inside become.
    """
    from onnxruntime.quantization import QuantFormat, QuantType, quantize_static

    with tempfile.TemporaryDirectory() as folder, whole_file(path) as partial:
        made = Path(folder) / "made.onnx"
        quantize_static(
            str(model),
            str(made),
            _Pictures(iter(pictures)),
            quant_format=QuantFormat.QDQ,
            per_channel=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            reduce_range=True,  # processors without VNNI add two products of bytes in sixteen bits
            nodes_to_exclude=[LAST],
        )
        partial.write_bytes(_with_metadata(onnx.load(made), onnx.load(model)).SerializeToString())


def _with_metadata(made: onnx.ModelProto, given: onnx.ModelProto) -> onnx.ModelProto:
    del made.metadata_props[:]
    made.metadata_props.extend(given.metadata_props)
    return made


class _Pictures:
    """What ONNX Runtime calls a reader of calibration data."""

    def __init__(self, pictures: Iterator[NDArray[np.float32]]) -> None:
        self.pictures = pictures

    def get_next(self) -> dict[str, Any] | None:
        picture = next(self.pictures, None)
        return None if picture is None else {"pictures": picture}
