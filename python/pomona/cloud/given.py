"""What may stand where a cloud is asked for."""

from __future__ import annotations

from os import PathLike
from pathlib import Path
from typing import Protocol, TypeAlias

from numpy.typing import ArrayLike

from pomona.cloud.files import look_at
from pomona.cloud.fruit_cloud import FruitCloud
from pomona.cloud.units import Unit
from pomona.errors import PomonaError

__all__ = ["Cloud", "as_cloud", "doubt_metres", "is_array"]


class WithCloud(Protocol):
    """What holds a cloud: a survey, a session, an orchard map."""

    @property
    def cloud(self) -> FruitCloud:
        """Its fruits."""


Cloud: TypeAlias = FruitCloud | WithCloud | ArrayLike | PathLike[str]
"""Fruits, (N, 3) metres, what holds a cloud, or the name of a file with one: .csv, .ply or .gpkg."""


def as_cloud(cloud: Cloud, unit: Unit = "m", *, name: str = "cloud") -> FruitCloud:
    """Take a cloud for itself, read it where it is the name of a file, and an array as positions.

    Parameters
    ----------
    cloud : FruitCloud, Survey, Session, OrchardMap, array_like, str or Path
        The fruits.
    unit : {"m", "cm", "mm", "free"}
        Of the coordinates, where it is a file; arrays are taken as they are.
    name : str
        What the caller calls it, for the error where there is none.

    Raises
    ------
    PomonaError
        The file or the array is wrong, or there is none.
    """
    if isinstance(cloud, FruitCloud):
        return cloud
    if isinstance(cloud, str | PathLike):
        return FruitCloud.read(Path(cloud), unit=unit)
    held = getattr(cloud, "cloud", None)
    if isinstance(held, FruitCloud):
        return held
    if cloud is None:
        raise PomonaError(f"{name}: found None, expected fruits, (N, 3) metres, or the name of a file with them")
    return FruitCloud(positions=cloud)  # type: ignore[arg-type] # looked at and converted there


def is_array(cloud: Cloud) -> bool:
    """Whether `as_cloud` takes a cloud as positions that nobody has looked at: files are, when they are read."""
    held = getattr(cloud, "cloud", cloud)
    return not isinstance(held, FruitCloud | str | PathLike)


def doubt_metres(name: str, cloud: FruitCloud) -> None:
    """Warn where the places of a cloud cannot be metres, once for each."""
    look_at(name, cloud, remedy="multiply it, or give scale='free' where its unit is unknown")
