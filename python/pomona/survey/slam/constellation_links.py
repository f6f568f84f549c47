"""Where one frame's camera is in another one's frame, by the constellations of the fruits that both saw."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from pomona.answer import Verdict
from pomona.cloud import FruitCloud
from pomona.core_settings import core_settings
from pomona.core_threads import core_threads
from pomona.localize import Localization, Localizer
from pomona.survey.refinement import Motions

__all__ = ["ConstellationLink", "Constellations", "chained", "linked", "motions_of", "once"]

SAME_VISIT: Mapping[str, Mapping[str, float]] = {"localization": {"own_m": 0.005, "shared_m": 0.001}}
"""Within a visit nothing grows or sags: the middle of a fruit differs by what each side shows of it, and wind."""

NEIGHBOURS: Mapping[str, Mapping[str, float]] = {
    "localization": {**SAME_VISIT["localization"], "false_alarm_rate": 1e-3},
    "verified": {"false_alarm_rate": 0.3},
}
"""Frames that follow each other mostly do see the same fruits: less evidence will do than for a place on any map."""

NEAR = 3
"""Frames before that each is looked for in."""

REACH = 10
"""Frames before that it is looked for in as long as it is found in none."""

LEAST_FRUITS = 5
"""Fewer make no constellation that could be checked."""


@dataclass(frozen=True, eq=False)
class ConstellationLink:
    """One frame found in another one.

    Attributes
    ----------
    first, second : int
        Rows of the frames.
    first_from_second : (4, 4) float64
        Takes points of the second camera into the first.
    information : (6, 6) float64
        Inverse covariance of a step (translation, rotation) of the second camera in its own frame.
    pairs : (M, 2) int64
        Row in the first and row in the second frame of each fruit that both saw.
    probabilities : (M,) float64
        That the two are one fruit.
    """

    first: int
    second: int
    first_from_second: NDArray[np.float64]
    information: NDArray[np.float64]
    pairs: NDArray[np.int64]
    probabilities: NDArray[np.float64]

    def renamed(self, row_of: NDArray[np.int64]) -> ConstellationLink:
        """Name frames by other rows."""
        return replace(self, first=int(row_of[self.first]), second=int(row_of[self.second]))


class Constellations:
    """The fruits of each frame, in which other frames are looked for.

    Parameters
    ----------
    clouds : sequence of FruitCloud
        Of each frame, in the frame of its camera, with covariances.
    config : mapping, optional
        Values of the core's tables that differ from `pomona.default_config()` and from what is set here.
    threads : int, optional
        As in `pomona.Localizer`.
    """

    def __init__(
        self, clouds: Sequence[FruitCloud], *, config: Mapping[str, Any] | None = None, threads: int | None = None
    ) -> None:
        self._clouds, self._threads = list(clouds), core_threads(threads)
        # What is wrong with the settings is told before there are frames.
        core_settings(config)
        self._config = config or {}
        self.of(FruitCloud(np.eye(3)))
        self._ready: dict[int, Localizer] = {}

    def __len__(self) -> int:
        return len(self._clouds)

    @contextmanager
    def adding(self, cloud: FruitCloud) -> Iterator[None]:
        """Take what the next frame saw, unless what is done with it fails."""
        self._clouds.append(cloud)
        try:
            yield
        except BaseException:
            self._ready.pop(len(self) - 1, None)
            self._clouds.pop()
            raise

    def cloud(self, row: int) -> FruitCloud:
        """Give what a frame saw."""
        return self._clouds[row]

    def of(self, cloud: FruitCloud, *, neighbours: bool = False) -> Localizer:
        """Make fruits of the same visit ready to be looked in, for what follows on them or for anything."""
        config = _over(NEIGHBOURS if neighbours else SAME_VISIT, self._config)
        return Localizer(cloud, config=config, threads=self._threads)

    def looked_for(self, second: int, first: int) -> Localization | None:
        """Look for a frame in another one; None where they have too few fruits."""
        if min(len(self._clouds[first]), len(self._clouds[second])) < LEAST_FRUITS:
            return None
        if first not in self._ready:
            self._ready = {row: ready for row, ready in self._ready.items() if abs(row - first) <= REACH}
            self._ready[first] = self.of(self._clouds[first], neighbours=True)
        return self._ready[first].locate(self._clouds[second])


def chained(constellations: Constellations) -> list[ConstellationLink]:
    """Look for each frame in those just before it."""
    return [link for second in range(1, len(constellations)) for link in linked(constellations, second)]


def linked(constellations: Constellations, second: int) -> Iterator[ConstellationLink]:
    """Look for one frame in those just before it.

    Where several poses are as good, as by trees that are copies of each other, it is not looked for farther back: there
    the right one may be out of sight, and a wrong one would stand alone.
    """
    found = False
    for first in range(second - 1, max(second - 1 - REACH, -1), -1):
        if found and second - first > NEAR:
            return
        there = constellations.looked_for(second, first)
        if there is not None and there.status is Verdict.AMBIGUOUS:
            return
        if there is not None and there.map_from_camera is not None:
            found = True
            yield _link(first, second, there.map_from_camera, there)


def _link(first: int, second: int, first_from_second: NDArray[np.float64], found: Localization) -> ConstellationLink:
    information = np.asarray(np.linalg.inv(found.covariance), np.float64)
    return ConstellationLink(first, second, first_from_second, information, found.pairs[:, ::-1], found.probabilities)


class _Related(Protocol):
    """Two frames, one of which was found from the other."""

    @property
    def first(self) -> int: ...
    @property
    def second(self) -> int: ...
    @property
    def first_from_second(self) -> NDArray[np.float64]: ...
    @property
    def information(self) -> NDArray[np.float64]: ...


def motions_of(links: Sequence[_Related]) -> Motions:
    """Give links as motions, each of which may be wrong."""
    if not links:
        return Motions.none()
    return Motions(
        first=np.array([link.first for link in links], np.int64),
        second=np.array([link.second for link in links], np.int64),
        first_from_second=np.array([link.first_from_second for link in links]),
        information=np.array([link.information for link in links]),
        doubtful=np.ones(len(links), bool),
    )


def once(links: Sequence[ConstellationLink], n_frames: int) -> Motions:
    """Give links of some frames as motions; what each sighting says in several links counts as one."""
    return motions_of(links).weakened(min(1.0, (n_frames - 1) / max(len(links), 1)))


def _over(ours: Mapping[str, Mapping[str, float]], given: Mapping[str, Any]) -> dict[str, Any]:
    """Tables of settings; what the user gives counts, and the core refuses what is no table."""
    tables = {name: given.get(name, {}) for name in ours}
    return {**given, **{name: {**ours[name], **own} for name, own in tables.items() if isinstance(own, Mapping)}}
