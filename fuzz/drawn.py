"""Arguments for the core: mostly right, with everything in them that an array can hold and nobody expects."""

from __future__ import annotations

import json
import random
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona import _core

__all__ = ["REFUSALS", "Drawn", "look_at"]

NUMBERS = (0.0, -0.0, 1.0, -1.0, 0.5, 1e-300, 5e-324, 1e-9, 1e9, 1e30, 1e150, 1e300, -1e300, 1.7e308)
BAD = (float("nan"), float("inf"), float("-inf"))
CONFIG = _core.default_config()

REFUSALS = (ValueError, TypeError, OverflowError)
"""How the bindings say that an argument is wrong."""

INDICES = (-1, 0, 1, 2, 7, 2**31, 2**62, -(2**63), 2**63 - 1)


class Drawn:
    """Draws what a case consists of; its bytes are the seed, so that a case is a file of some bytes."""

    def __init__(self, content: bytes) -> None:
        self._draw = random.Random(content)
        self._arrays = np.random.default_rng(list(content[:64]))
        # Half of the cases are of finite numbers: else nothing gets beyond the first check.
        self._bad = self._draw.choice((0.0, 0.0, 0.02, 0.3))
        self._extreme = self._draw.choice((0.0, 0.0, 0.05, 0.5))
        self._odd = self._draw.choice((0.0, 0.0, 0.1))

    def choice(self, *values: Any) -> Any:
        """One of some values."""
        return self._draw.choice(values)

    def count(self) -> int:
        """Rows of an array."""
        return self._draw.choice((0, 1, 2, 3, 4, 5, 8, 12, 30, 60))

    def number(self) -> float:
        """A number of any size, or none."""
        if self._draw.random() < self._bad:
            return self._draw.choice(BAD)
        return self._draw.choice(NUMBERS) if self._draw.random() < self._extreme else self._draw.uniform(-2, 2)

    def positive(self) -> float:
        """A number that should be positive."""
        return abs(self.number()) if self._draw.random() > self._odd else self.number()

    def numbers(self, *shape: int) -> NDArray[np.float64]:
        """An array of float64: random, on a grid or all the same, with strange numbers in it."""
        array = self._arrays.normal(size=shape)
        how = self._draw.choice(("", "", "grid", "same"))
        array = np.round(array) if how == "grid" else np.zeros(shape) + self.number() if how == "same" else array
        for share, values in ((self._extreme, NUMBERS), (self._bad, BAD)):
            array[self._arrays.random(shape) < share] = self._draw.choice(values)
        return np.asarray(self._strange(array * self._draw.choice((1.0, 1.0, 100.0))))

    def covariances(self, n: int) -> NDArray[np.float64]:
        """Matrices (n, 3, 3), mostly symmetric and positive."""
        half = self.numbers(n, 3, 3)
        if half.shape != (n, 3, 3) or half.dtype != np.float64 or self._draw.random() < self._odd:
            return half
        with np.errstate(all="ignore"):
            return np.asarray(1e-3 * half @ half.transpose(0, 2, 1) + 1e-6 * np.eye(3))

    def pose(self) -> list[list[float]]:
        """A rigid transform, mostly; always 4 x 4."""
        poses = self.poses(1)
        return (poses[0] if poses.shape == (1, 4, 4) else np.eye(4)).tolist()

    def poses(self, n: int) -> NDArray[np.float64]:
        """Rigid transforms (n, 4, 4), mostly."""
        from scipy.spatial.transform import Rotation

        poses = np.tile(np.eye(4), (n, 1, 1))
        if n:
            poses[:, :3, :3] = Rotation.random(n, random_state=self._draw.randrange(1000)).as_matrix()
            poses[:, :3, 3] = self._arrays.normal(size=(n, 3))
        poses[self._arrays.random(poses.shape) < self._extreme / 10] = self.number()
        return np.asarray(self._strange(poses))

    def rows(self, n: int, below: int) -> NDArray[np.int64]:
        """Rows (n,) of an array of so many."""
        rows = self._arrays.integers(0, max(below, 1), n)
        rows[self._arrays.random(n) < self._odd] = self._draw.choice(INDICES)
        return np.asarray(self._strange(rows))

    def config(self) -> str:
        """Settings, now and then with one that is absurd."""
        config = json.loads(CONFIG)
        if self.choice(False, False, True):
            table = self.choice(*(value for value in config.values() if isinstance(value, dict)))
            name = self.choice(*table)
            table[name] = self.choice(0, -1, 1, 1e300, -0.5, 1e-300, 2**40, None, "x", True, [], table[name])
        return json.dumps(config)

    def bytes_of(self, *shape: int) -> NDArray[np.uint8]:
        """A picture."""
        return np.asarray(self._strange(self._arrays.integers(0, 256, shape, np.uint8)))

    def _strange(self, array: NDArray[Any]) -> NDArray[Any]:
        """Now and then another shape, type or order in memory."""
        if self._draw.random() >= self._odd:
            return array
        how = self._draw.choice(("short", "empty", "flat", "type", "fortran", "steps", "backwards", "big"))
        changed: dict[str, Any] = {
            "short": array[:-1],
            "empty": array[:0],
            "flat": array.ravel(),
            "type": array.astype(np.float32),
            "fortran": np.asfortranarray(array),
            "steps": np.repeat(array, 2, axis=0)[::2],
            "backwards": array[::-1],
            "big": array.astype(array.dtype.newbyteorder(">")),
        }
        return np.asarray(changed[how])


def look_at(found: Any) -> None:
    """Ask for all that an answer has."""
    for name in dir(found):
        if not name.startswith("_"):
            getattr(found, name)
