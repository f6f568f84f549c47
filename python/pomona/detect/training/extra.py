"""What training needs besides the plain install."""

from __future__ import annotations

from importlib.util import find_spec

from pomona.errors import PomonaError

__all__ = ["require_train"]

NEEDED = ("torch", "onnx")


def require_train() -> None:
    """Ask for the extra.

    Raises
    ------
    PomonaError
        With the one command that installs what is missing.
    """
    missing = [name for name in NEEDED if find_spec(name) is None]
    if missing:
        raise PomonaError(f"training needs {' and '.join(missing)}, not installed: pip install torch onnx")
