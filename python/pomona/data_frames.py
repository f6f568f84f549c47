"""Tables for pandas and GeoPandas, which are not needed for anything else."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.geopackage import LOCAL_METRES

__all__ = ["to_geopandas", "to_pandas"]


def to_pandas(columns: Mapping[str, Any]) -> Any:
    """Give a `pandas.DataFrame` of columns.

    Raises
    ------
    PomonaError
        When pandas is not installed.
    """
    return _library("pandas").DataFrame(dict(columns))


def to_geopandas(columns: Mapping[str, Any], positions: NDArray[np.float64]) -> Any:
    """Give a `geopandas.GeoDataFrame` of columns, with (N, 3) positions as points in local metres.

    Raises
    ------
    PomonaError
        When GeoPandas is not installed.
    """
    geopandas = _library("geopandas")
    points = geopandas.points_from_xy(*positions.T)
    return geopandas.GeoDataFrame(dict(columns), geometry=points, crs=LOCAL_METRES)


def _library(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError:
        raise PomonaError(f"{name}: not installed, expected it here: pip install {name}") from None
