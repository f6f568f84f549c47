"""How the shipped detector was trained: `python -m training DATA -o RUN`."""

from pathlib import Path

__all__ = ["WIDE"]

WIDE = Path(__file__).parents[1] / "models" / "fruits_wide_int8.onnx"
"""The teacher of the shipped detector, too large and slow for the package."""
