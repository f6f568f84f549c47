"""The detector that is inside: our own network, trained on photographs of apples and rendered ones."""

from __future__ import annotations

from pathlib import Path

__all__ = ["EXACT", "SHIPPED", "is_shipped", "model_named"]

MODELS = Path(__file__).parent / "model"

SHIPPED = "shipped"
"""Name of the detector of eight bits, which runs where no other is named; no file of this name is looked for."""

EXACT = "shipped-fp32"
"""Name of the same in 32 bits: slower, and what `pomona train` begins with."""

FILES = {SHIPPED: MODELS / "fruits_int8.onnx", EXACT: MODELS / "fruits.onnx"}


def is_shipped(model: str | Path) -> bool:
    """Tell the name of a shipped model from a file."""
    return str(model) in FILES


def model_named(model: str | Path) -> Path:
    """Give the file of a model: a path, or the name of a shipped one."""
    return FILES.get(str(model), Path(model))
