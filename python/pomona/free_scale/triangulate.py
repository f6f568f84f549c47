"""Posed pictures of one camera alone become a session: in metres where a map says the scale, else marked as without."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.cloud import FruitCloud
from pomona.detect.opening import FoundBoxes
from pomona.free_scale.metric import Upgrade
from pomona.orchard import write_session
from pomona.orchard.session import GUESSED
from pomona.scanning import guessed_date
from pomona.store.values import FREE
from pomona.survey.files import hashes_of
from pomona.trajectory import Trajectory
from pomona.triangulation.model_recording import ModelRecording

__all__ = ["triangulate"]

MODEL_UNITS = "diameter_model_units"
"""Column of the diameters where nobody knows the scale: `diameter_m` would say metres."""


def triangulate(
    output: Path,
    cloud: FruitCloud,
    recording: ModelRecording,
    boxes: FoundBoxes,
    *,
    upgrade: Upgrade | None = None,
    name: str | None = None,
    date: str | None = None,
) -> None:
    """Write the fruits of a model as a session.

    Parameters
    ----------
    output : Path
        The .gpkg; a session that is there is replaced, a map never.
    cloud : FruitCloud
        As `fruits_of_model` gives it.
    recording, boxes
        What it was made of.
    upgrade : Upgrade, optional
        How the model lies in a map; the session then is in metres, in the frame of that map. Without it the session
        keeps the frame and unit of the model, says so, and no map takes it.
    name, date : str, optional
        Of the session; else the folder's name and the day of its newest file.
    """
    scaling = None if upgrade is None else upgrade.scaling
    about: dict[str, Any] = {"detector": boxes.configuration, "named": False}
    if upgrade is None or scaling is None:
        about["scale"], placed, trajectory = FREE, _without_metres(cloud), recording.trajectory
    else:
        about["scale"], placed = upgrade.numbers, cloud.transformed(scaling.map_from_model)
        placed = _in_metres(placed, scaling.scale)
        trajectory = _moved(recording.trajectory, scaling.map_from_model)
    write_session(
        output,
        placed,
        name=name or recording.name,
        date=date or guessed_date(recording),
        recording=str(recording.path.resolve()),
        trajectory=trajectory,
        configuration={"scan": {**about, **_of_date(date)}},
        input_hashes=hashes_of(recording, boxes.inputs),
        force=True,  # what may be replaced was asked before the work began
    )


def _of_date(date: str | None) -> Mapping[str, str]:
    return {} if date else {"date": GUESSED}


def _without_metres(cloud: FruitCloud) -> FruitCloud:
    assert cloud.diameters_m is not None
    sigmas = cloud.extras["diameter_sigma_m"]
    diameters = tuple(f"{diameter:.6g}" for diameter in cloud.diameters_m.tolist())
    return replace(cloud, diameters_m=None, extras={MODEL_UNITS: diameters, "diameter_sigma_model_units": sigmas})


def _in_metres(cloud: FruitCloud, scale: float) -> FruitCloud:
    sigmas_m = (scale * float(cell) for cell in cloud.extras["diameter_sigma_m"])
    return replace(cloud, extras={**cloud.extras, "diameter_sigma_m": tuple(f"{one:.6f}" for one in sigmas_m)})


def _moved(trajectory: Trajectory, map_from_model: NDArray[np.float64]) -> Trajectory:
    scale = np.cbrt(np.linalg.det(map_from_model[:3, :3]))
    poses = map_from_model @ trajectory.session_from_camera
    poses[:, :3, :3] /= scale
    return replace(trajectory, session_from_camera=poses)
