"""The fruits of one visit, and the files they live in."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pomona.arrays import checked_array, kept_array
from pomona.cards import as_card
from pomona.cloud.columns import MOST_WHOLE
from pomona.cloud.covariances import are_covariances
from pomona.cloud.facts import facts
from pomona.cloud.text_columns import checked_extras, checked_ids
from pomona.cloud.units import Unit
from pomona.errors import PomonaError
from pomona.file_names import given_path
from pomona.reading import shown
from pomona.views import Views

__all__ = ["FruitCloud"]

UNEVEN = 1e-3
"""Part by which lengths may differ by direction: a matrix that was printed with four digits still goes."""


@dataclass(frozen=True, eq=False, repr=False)
class FruitCloud:
    """Sparse landmarks of one visit, one row a fruit, in the session's own frame of reference.

    Its arrays are copies that cannot be written into: `dataclasses.replace` makes another cloud.

    Attributes
    ----------
    positions : (N, 3) float64
        Centres of the fruits, metres.
    ids : tuple of N str, optional
        Names of the fruits, each used once; any text but none.
    diameters_m : (N,) float64, optional
        Diameters in metres, NaN where unknown.
    covariances : (N, 3, 3) float64, optional
        Covariances of the centres, square metres.
    n_views : (N,) int64, optional
        Number of frames that saw the fruit.
    views : Views, optional
        Which frame saw which fruit.
    extras : mapping of str to tuple of N str
        Other columns of the file, kept as they were written.

    Raises
    ------
    PomonaError
        When an array has the wrong shape, a number is not finite, a covariance is none, an id is empty or used twice,
        or a text has half a character in it, which no file can hold.
    """

    positions: NDArray[np.float64]
    ids: tuple[str, ...] | None = None
    diameters_m: NDArray[np.float64] | None = None
    covariances: NDArray[np.float64] | None = None
    n_views: NDArray[np.int64] | None = None
    views: Views | None = None
    extras: Mapping[str, tuple[str, ...]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        positions = kept_array("positions", self.positions, np.float64, (None, 3))
        n = len(positions)
        _require_finite("positions", positions)
        object.__setattr__(self, "positions", positions)
        if self.diameters_m is not None:
            object.__setattr__(self, "diameters_m", _diameters(self.diameters_m, n))
        if self.covariances is not None:
            covariances = kept_array("covariances", self.covariances, np.float64, (n, 3, 3))
            _require_covariances(covariances)
            object.__setattr__(self, "covariances", covariances)
        if self.n_views is not None:
            object.__setattr__(self, "n_views", _counts(self.n_views, n))
        if self.ids is not None:
            object.__setattr__(self, "ids", checked_ids(self.ids, n))
        if self.views is not None:
            _require_views(self.views, n)
        object.__setattr__(self, "extras", checked_extras(self.extras, n))

    def __len__(self) -> int:
        return len(self.positions)

    def __repr__(self) -> str:
        return f"FruitCloud({', '.join(f'{name}: {value}' for name, value in facts(self).items())})"

    def _repr_html_(self) -> str:
        return as_card("FruitCloud", facts(self))

    @classmethod
    def read(cls, path: str | Path, *, unit: Unit = "m") -> FruitCloud:
        """Read a cloud from a .csv, .ply or .gpkg file.

        Parameters
        ----------
        path : str or Path
            CSV or PLY with ``x, y, z``, a session or an orchard map. Of a map: each fruit where it was last seen.
        unit : {"m", "cm", "mm", "free"}
            Unit of the coordinates in the file. They come back in metres, and a `PomonaWarning` tells when the
            distances between neighbours cannot be those of fruits; ``free`` keeps the numbers and asks nothing.

        Raises
        ------
        PomonaError
            One line with the file, the line and column, what was found and what was expected.
        """
        from pomona.cloud.files import read_cloud

        return read_cloud(given_path(path), unit, cls)

    def write(self, path: str | Path) -> None:
        """Write a .csv or .ply file, in metres; the file appears whole or not at all.

        A session (.gpkg) also has a name and a date: `pomona.orchard.write_session` writes it.

        Raises
        ------
        PomonaError
            The file cannot be written, or not so that it could be read again: two columns have the same name but for
            blanks around it, or a PLY cannot name one.
        """
        from pomona.cloud.files import write_cloud

        write_cloud(given_path(path), self)

    def select(self, rows: ArrayLike) -> FruitCloud:
        """Return the fruits ``rows`` (row numbers, each once, or a mask) in that order, with their sightings.

        Raises
        ------
        PomonaError
            A row is not there, or named twice.
        """
        picked = _rows(rows, len(self))

        def text(column: tuple[str, ...]) -> tuple[str, ...]:
            return tuple(column[row] for row in picked)

        return FruitCloud(
            positions=self.positions[picked],
            ids=None if self.ids is None else text(self.ids),
            diameters_m=None if self.diameters_m is None else self.diameters_m[picked],
            covariances=None if self.covariances is None else self.covariances[picked],
            n_views=None if self.n_views is None else self.n_views[picked],
            views=None if self.views is None else _select_views(self.views, picked, len(self)),
            extras={name: text(column) for name, column in self.extras.items()},
        )

    def transformed(self, map_from_query: ArrayLike) -> FruitCloud:
        """Return the cloud in another frame.

        Parameters
        ----------
        map_from_query : (4, 4) array_like
            Rigid or similarity transform, homogeneous, scale folded in. A scale also scales diameters.

        Raises
        ------
        PomonaError
            When it mirrors, stretches or shears.
        """
        transform = checked_array("map_from_query", map_from_query, np.float64, (4, 4))
        _require_similarity(transform)
        linear, translation_m = transform[:3, :3], transform[:3, 3]
        scale = float(np.cbrt(np.linalg.det(linear)))
        return replace(
            self,
            positions=self.positions @ linear.T + translation_m,
            covariances=None if self.covariances is None else linear @ self.covariances @ linear.T,
            diameters_m=None if self.diameters_m is None else self.diameters_m * scale,
        )

    def to_pandas(self) -> Any:
        """Return a `pandas.DataFrame`, one row a fruit, with the columns of the file; numbers are numbers.

        Raises
        ------
        PomonaError
            When pandas is not installed.
        """
        from pomona.cloud.columns import typed_columns
        from pomona.data_frames import to_pandas

        return to_pandas(typed_columns(self))

    def to_geopandas(self) -> Any:
        """Return a `geopandas.GeoDataFrame` of the same columns, with the positions as points in local metres.

        Raises
        ------
        PomonaError
            When GeoPandas is not installed.
        """
        from pomona.cloud.columns import typed_columns
        from pomona.data_frames import to_geopandas

        return to_geopandas(typed_columns(self), self.positions)

    def label(self, row: int) -> str:
        """Return the id of a row, the row number where there are no ids."""
        return str(int(row)) if self.ids is None else self.ids[row]


def _require_finite(name: str, array: NDArray[np.float64]) -> None:
    finite = np.isfinite(array)
    if not finite.all():
        row = int(np.argmin(finite.reshape(len(array), -1).all(axis=1)))
        raise PomonaError(f"{name}: row {row} is NaN or infinite, expected finite numbers")


def _require_covariances(covariances: NDArray[np.float64]) -> None:
    _require_finite("covariances", covariances)
    right = are_covariances(covariances)
    if not right.all():
        raise PomonaError(f"covariances: row {int(np.argmin(right))} is not symmetric positive semi-definite")


def _diameters(values: ArrayLike, n: int) -> NDArray[np.float64]:
    diameters_m: NDArray[np.float64] = kept_array("diameters_m", values, np.float64, (n,))
    # NaN compares false and so stays allowed: the diameter of that fruit is unknown.
    wrong = (diameters_m <= 0) | np.isinf(diameters_m)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise PomonaError(f"diameters_m: row {row} is {diameters_m[row]}, expected positive metres or NaN")
    return diameters_m


def _counts(values: ArrayLike, n: int) -> NDArray[np.int64]:
    counts: NDArray[np.int64] = kept_array("n_views", values, np.int64, (n,))
    wrong = (counts < 0) | (counts > MOST_WHOLE)  # no reader of a file believes them
    if wrong.any():
        row = int(np.argmax(wrong))
        raise PomonaError(f"n_views: row {row} is {counts[row]}, expected a number of frames")
    return counts


def _require_similarity(transform: NDArray[np.float64]) -> None:
    linear = transform[:3, :3]
    volume = float(np.linalg.det(linear))
    square = np.cbrt(abs(volume)) ** 2 * np.eye(3)
    is_even = np.isfinite(transform).all() and np.allclose(linear.T @ linear, square, atol=UNEVEN * square[0, 0])
    if volume == 0 or not is_even or not np.allclose(transform[3], (0, 0, 0, 1)):
        raise PomonaError("map_from_query: found a stretch or shear, expected a rigid or similarity transform")
    if volume < 0:
        raise PomonaError("map_from_query: found a mirror, expected a rigid or similarity transform")


def _require_views(views: Views, n: int) -> None:
    if not isinstance(views, Views):
        raise PomonaError(f"views: found {shown(views)}, expected pomona.Views")
    if len(views) and not 0 <= views.fruits.min() <= views.fruits.max() < n:
        raise PomonaError(f"views.fruits: a sighting names a row outside 0..{n - 1}")


def _rows(rows: ArrayLike, n: int) -> NDArray[np.int64]:
    """Return row numbers of N, which may be given as a mask or from the end."""
    try:
        asked = np.asarray(rows)
        picked = np.arange(n)[asked] if asked.size else np.empty(0, np.int64)
    except (IndexError, ValueError):
        picked = None
    if picked is None or picked.ndim != 1:
        raise PomonaError(f"select: found {shown(rows)}, expected numbers of {n} rows, or a mask of them")
    if len(np.unique(picked)) != len(picked):
        raise PomonaError("select: a row is named twice, expected each row once")
    return picked


def _select_views(views: Views, picked: NDArray[np.int64], n: int) -> Views:
    new_row = np.full(n, -1, dtype=np.int64)
    new_row[picked] = np.arange(len(picked))
    fruits = new_row[views.fruits]
    kept = fruits >= 0
    return Views(frames=views.frames[kept], fruits=fruits[kept])
