"""One visit: the fruits, when and how they were recorded, and what they were made from."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona import __version__
from pomona.cloud import FruitCloud
from pomona.errors import PomonaError
from pomona.fruit_crop import FruitCrop
from pomona.reading import shown
from pomona.store.values import FARTHEST_M, is_scale_free, iso_date
from pomona.trajectory import Trajectory
from pomona.unicode_text import UNICODE, broken_at

__all__ = ["GUESSED", "Session"]

GUESSED = "guessed from the age of the files"
"""What `configuration["scan"]["date"]` of a session says when nobody noted the day of the visit."""


@dataclass(frozen=True, eq=False)
class Session:
    """One visit in its own frame of reference.

    Attributes
    ----------
    name : str
        Name of the session, used once in a map.
    date : str
        Local date or date and time of the visit, ISO 8601: ``2021-09-27`` or ``2021-09-27T11:40:12``.
    recording : str
        Where the session came from.
    cloud : FruitCloud
        Its fruits; ids are the session's own names, of which the map keeps a note and nothing more.
    trajectory : Trajectory, optional
        Camera poses.
    configuration : mapping
        Effective settings of the program that made the cloud, JSON values.
    input_hashes : mapping of str to str
        File name to SHA-256 of the inputs.
    program_version : str
        Version of the program that made the cloud.
    crops : mapping of int to FruitCrop
        Small pictures of fruits, by row of the cloud.
    """

    name: str
    date: str
    recording: str
    cloud: FruitCloud
    trajectory: Trajectory | None = None
    configuration: Mapping[str, object] = field(default_factory=dict)
    input_hashes: Mapping[str, str] = field(default_factory=dict)
    program_version: str = __version__
    crops: Mapping[int, FruitCrop] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._require_kinds()
        if not self.name.strip():
            raise PomonaError("session: found an empty name, expected one that is used once in a map")
        object.__setattr__(self, "date", iso_date(self.date))
        _json("configuration", self.configuration)
        if len(self.cloud) and np.abs(self.cloud.positions).max() > FARTHEST_M:
            raise PomonaError(f"session {self.name}: found a fruit beyond {FARTHEST_M:g} m")
        texts = (self.name, self.recording)
        if (broken := broken_at(texts)) is not None:
            raise PomonaError(f"session: found {shown(texts[broken])}, expected {UNICODE}")

    def _require_kinds(self) -> None:
        """Refuse what is something else than was asked for; whoever calls from Python has no compiler to say so."""
        _require_kind("name", self.name, str, "str")
        _require_kind("recording", self.recording, str, "str")
        _require_kind("cloud", self.cloud, FruitCloud, "FruitCloud")
        _require_kind("trajectory", self.trajectory, Trajectory | None, "Trajectory")
        for name, mapping in (("configuration", self.configuration), ("input_hashes", self.input_hashes)):
            _require_kind(name, mapping, Mapping, "a mapping")
        _require_kind("crops", self.crops, Mapping, "a mapping")
        for row, crop in self.crops.items():
            if row not in range(len(self.cloud)):
                raise PomonaError(f"session: crops: found row {shown(row)}, expected one of {len(self.cloud)} fruits")
            _require_kind("crops", crop, FruitCrop, "FruitCrop")

    @property
    def is_date_guessed(self) -> bool:
        """Whether the date is only that of the newest file of the recording."""
        scan = self.configuration.get("scan")
        return isinstance(scan, Mapping) and scan.get("date") == GUESSED

    @property
    def is_scale_free(self) -> bool:
        """Whether its unit is that of a reconstruction whose scale nobody knows."""
        return is_scale_free(self.configuration)

    @property
    def content_sha256(self) -> str:
        """Hash of what was seen, whatever the session is called and in whatever order its fruits are."""
        digest = hashlib.sha256()
        cloud = self.cloud.select(_by_place(self.cloud))
        views = () if cloud.views is None else np.unique((cloud.views.frames, cloud.views.fruits), axis=1)
        for array in (cloud.positions, cloud.diameters_m, cloud.covariances, cloud.n_views, *views):
            # The length in front keeps two different lists of arrays from running into the same bytes.
            content = b"" if array is None else array.tobytes()
            digest.update(len(content).to_bytes(8, "little") + content)
        digest.update(_json("ids", cloud.ids).encode())
        return digest.hexdigest()

    @property
    def configuration_json(self) -> str:
        """The configuration as the files hold it."""
        return _json("configuration", self.configuration)

    @property
    def input_hashes_json(self) -> str:
        """The input hashes as the files hold them."""
        return _json("input_hashes", self.input_hashes)


def _by_place(cloud: FruitCloud) -> NDArray[np.int64]:
    """Return the rows of a cloud in an order that does not depend on theirs."""
    n = len(cloud)
    names = np.zeros(n, np.int64) if cloud.ids is None else np.unique(np.array(cloud.ids), return_inverse=True)[1]
    columns = [cloud.positions, cloud.diameters_m, cloud.covariances, cloud.n_views, names]
    known = [column for column in columns if column is not None]
    table = np.concatenate([column.reshape(n, math.prod(column.shape[1:])) for column in known], axis=1)
    return np.lexsort(table.T[::-1])


def _require_kind(name: str, found: object, kind: Any, expected: str) -> None:
    if not isinstance(found, kind):
        raise PomonaError(f"session: {name}: found {type(found).__name__}, expected {expected}")


def _json(name: str, value: object) -> str:
    try:
        return json.dumps(dict(value) if isinstance(value, Mapping) else value, sort_keys=True, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise PomonaError(f"session: {name} is not JSON: {error}") from None
