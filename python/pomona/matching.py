"""Which fruit of the query is which fruit of the map: the Python face of the core's matcher."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pomona import _core
from pomona.amounts import amount
from pomona.atomic import whole_file
from pomona.cards import as_card
from pomona.cloud import Cloud, FruitCloud, Unit, as_cloud
from pomona.cloud.given import doubt_metres, is_array
from pomona.core_settings import core_settings
from pomona.errors import PomonaError
from pomona.file_names import given_path
from pomona.kept_index import out_of_index
from pomona.likes import INDEX
from pomona.match_arguments import given_flag, given_noise, given_pose
from pomona.outputs import Output, require_outputs
from pomona.threads import capped_threads

Method: TypeAlias = Literal["paper", "verified"]
Scale: TypeAlias = Literal["metric", "free"]
Up: TypeAlias = Sequence[Sequence[float]]


class Verdict(StrEnum):
    """What a match says. All four are results; none is an error."""

    FOUND = "Found"
    TOO_FEW = "TooFew"
    AMBIGUOUS = "Ambiguous"
    NO_MATCH = "NoMatch"


@dataclass(frozen=True, eq=False, repr=False)
class Match:
    """Registration, pairs and verdict of one query; true where the query was found.

    Attributes
    ----------
    status
        The verdict.
    map_from_query
        (4, 4), the scale folded in; None where nothing was found.
    scale
        Length in the map over length in the query; None where nothing was found.
    log_odds
        Evidence against chance in nats; NaN where nothing was found.
    pairs
        (M, 2), row in the query and row in the map, one to one, sorted by query row.
    probabilities
        (M,), probability that the two are one fruit.
    distances_m
        (M,), distance after registration, metres of the map.
    support
        (M,), what speaks for the pair: votes (paper) or nats (verified).
    alternatives
        (4, 4) each: other registrations as good as the first; empty unless ambiguous.
    noise_m
        Relative noise of the two visits per axis, metres; NaN where nothing was found.
    stages
        What happened: stage and count, in order.
    n_query, n_map
        Fruits in the two clouds.
    elapsed_s
        Wall time of the search, and of making the index where it was made for this query.
    """

    status: Verdict
    map_from_query: NDArray[np.float64] | None
    scale: float | None
    log_odds: float
    pairs: NDArray[np.int64]
    probabilities: NDArray[np.float64]
    distances_m: NDArray[np.float64]
    support: NDArray[np.float64]
    alternatives: tuple[NDArray[np.float64], ...]
    noise_m: float
    stages: tuple[tuple[str, float], ...]
    n_query: int
    n_map: int
    elapsed_s: float

    def __bool__(self) -> bool:
        return self.status is Verdict.FOUND

    def __repr__(self) -> str:
        if not self:
            return f"Match({self.status}: {amount(self.n_query, 'fruit')}, {self.n_map} in the map)"
        found = f"{len(self.pairs)} of {amount(self.n_query, 'fruit')} again among {self.n_map}"
        return f"Match({self.status}: {found}, log-odds {self.log_odds:.0f})"

    def _repr_html_(self) -> str:
        facts: dict[str, object] = {"fruits": f"{self.n_query} in the query, {self.n_map} in the map"}
        if self:
            middle_cm = f", {100 * np.median(self.distances_m):.1f} cm apart (median)" if len(self.pairs) else ""
            facts |= {"found again": f"{len(self.pairs)}{middle_cm}", "log-odds": f"{self.log_odds:.0f}"}
            facts |= {"scale": f"{self.scale:.4g}", "noise": f"{100 * self.noise_m:.1f} cm per axis"}
        return as_card(self.status, {**facts, "time": f"{self.elapsed_s:.3f} s"})


class Index:
    """A map made ready once for many queries.

    Parameters
    ----------
    map
        A cloud, (N, 3) metres, or the name of a file with one.
    scale
        "metric" where both clouds are in metres, "free" where the ratio of their scales is unknown.
    method
        "verified", or "paper" for the published method.
    config
        Values of the core's tables that differ from `default_config()`; unknown keys are errors.
    threads
        Threads of the search, from 1, of which no more than there are cores are used; None takes all. The answer does
        not depend on it.
    compact
        Keep only constellations of rare shape: a tenth of the memory, and an index that can be saved. A map of more
        than 300,000 fruits has no other. By the verified method, metric.

    Raises
    ------
    PomonaError
        An array or a setting is wrong, or no such index is compact.
    """

    def __init__(
        self,
        map: Cloud,
        *,
        scale: Scale = "metric",
        method: Method = "verified",
        config: Mapping[str, Any] | None = None,
        threads: int | None = None,
        compact: bool = False,
    ) -> None:
        for name, found, known in (("method", method, Method), ("scale", scale, Scale)):
            if found not in get_args(known):
                expected = " or ".join(repr(one) for one in get_args(known))
                raise PomonaError(f"{name}: found {found!r}, expected {expected}")
        if compact and (method, scale) != ("verified", "metric"):
            raise PomonaError(f"compact: found an index by {method}, {scale}; expected one by verified, metric")
        self._unit: Unit = "free" if scale == "free" else "m"
        self._map, self._of_array = as_cloud(map, self._unit, name="map"), is_array(map)
        self._kind = f"{method}, {scale}"
        threads = capped_threads(threads)
        overrides = core_settings(config)
        try:
            if compact:
                self._core = _core.MapIndex.compact(core_arrays(self._map), config=overrides, threads=threads)
            else:
                self._core = _core.MapIndex(
                    core_arrays(self._map), method=method, scale=scale, config=overrides, threads=threads
                )
        except (ValueError, TypeError, OverflowError) as error:
            raise _named("map", error) from None

    @classmethod
    def open(
        cls,
        path: str | Path,
        map: Cloud,
        *,
        config: Mapping[str, Any] | None = None,
        threads: int | None = None,
    ) -> Index:
        """Open the index of `map` that `save` wrote; the file is mapped, so that processes share what they read of it.

        Where it was made from another map or by another version, or is damaged, it is made anew and saved in its place;
        a `PomonaWarning` says so, and why.

        Parameters
        ----------
        path
            The file.
        map, config, threads
            As for a new index. The places of the fruits must be those that the index was made from.

        Raises
        ------
        PomonaError
            The file is missing or is no index; an array or a setting is wrong.
        """
        cloud, settings, most = as_cloud(map, "m", name="map"), core_settings(config), capped_threads(threads)
        arrays = core_arrays(cloud)
        index = cls.__new__(cls)
        index._unit, index._kind, index._map, index._of_array = "m", "verified, metric", cloud, is_array(map)
        index._core = out_of_index(
            given_path(path),
            lambda path: _core.MapIndex.opened(path, arrays, config=settings, threads=most),
            lambda path: cls(cloud, config=config, threads=threads, compact=True).save(path),
        )
        return index

    def save(self, path: str | Path) -> None:
        """Write a compact index into a file, which appears whole or not at all.

        Raises
        ------
        PomonaError
            The index is not compact; something else than an index is there; the file cannot be written.
        """
        if not self._core.is_compact:
            raise PomonaError(f"{path}: found an index that is not compact, expected one made with compact=True")
        target = given_path(path)
        require_outputs([Output(target, INDEX)], [], otherwise="remove it first")
        with whole_file(target) as partial:
            self._core.save(partial)

    def __len__(self) -> int:
        return len(self._map)

    def __repr__(self) -> str:
        return f"Index({amount(len(self), 'fruit')}, {self._kind})"

    def _repr_html_(self) -> str:
        return as_card("Index", {"fruits": len(self), "method": self._kind})

    def match(
        self, query: Cloud, *, noise_m: float | None = None, up: Up | None = None, per_frame: bool = False
    ) -> Match:
        """Find `query` in the map; arguments as in `pomona.match`."""
        noise, vertical, by_frame = given_noise(noise_m), core_vertical(up), given_flag("per_frame", per_frame)
        return self._ask(
            query, lambda core, arrays: core.search(arrays, noise_m=noise, up=vertical, per_frame=by_frame)
        )

    def pairs_under(self, query: Cloud, map_from_query: ArrayLike, *, noise_m: float | None = None) -> Match:
        """Pair `query` with the map under a pose that is known: the last stage of the verified method alone.

        Parameters
        ----------
        query
            A cloud, (N, 3), or the name of a file with one.
        map_from_query
            (4, 4), the scale folded in.
        noise_m
            Standard deviation per axis of the difference of the two visits; None: 2 cm in an orchard.

        Raises
        ------
        PomonaError
            An array is wrong, or the index is not one of the verified method.
        """
        pose, noise = given_pose(map_from_query), given_noise(noise_m)
        return self._ask(query, lambda core, arrays: core.pairs_under(arrays, map_from_query=pose, noise_m=noise))

    def _ask(self, query: Cloud, question: Callable[[_core.MapIndex, Any], _core.Match]) -> Match:
        start = time.perf_counter()
        cloud = as_cloud(query, self._unit, name="query")
        try:
            found = question(self._core, core_arrays(cloud))
        except (ValueError, TypeError, OverflowError) as error:
            raise _named("query", error) from None
        if found.status == Verdict.NO_MATCH and self._unit != "free":
            for name, asked, of_array in (("query", cloud, is_array(query)), ("map", self._map, self._of_array)):
                if of_array:  # looked at only now, for it takes longer than many a search
                    doubt_metres(name, asked)
        return _told(found, len(cloud), len(self._map), start)


OF_NO_CLOUD = ("configuration", "map_from_query", "noise_m", "per_frame", "setting", "up")
"""What the core's errors begin with where they are not about the fruits."""


def _named(cloud: str, error: Exception) -> PomonaError:
    told = str(error)
    return PomonaError(told if told.startswith(OF_NO_CLOUD) else f"{cloud}: {told}")


def _told(found: _core.Match, n_query: int, n_map: int, start: float) -> Match:
    return Match(
        status=Verdict(found.status),
        map_from_query=found.map_from_query,
        scale=found.scale,
        log_odds=float("nan") if found.log_odds is None else found.log_odds,
        pairs=found.pairs,
        probabilities=found.probabilities,
        distances_m=found.distances_m,
        support=found.support,
        alternatives=tuple(np.array(matrix) for matrix, _ in found.alternatives),
        noise_m=found.noise_m,
        stages=tuple(found.stages),
        n_query=n_query,
        n_map=n_map,
        elapsed_s=time.perf_counter() - start,
    )


def match(
    query: Cloud,
    map: Cloud,
    *,
    scale: Scale = "metric",
    method: Method = "verified",
    noise_m: float | None = None,
    up: Up | None = None,
    per_frame: bool = False,
    config: Mapping[str, Any] | None = None,
    threads: int | None = None,
) -> Match:
    """Say which fruit of `query` is which fruit of `map`, and where the query lies in the map.

    Parameters
    ----------
    query, map
        Clouds, (N, 3) metres, or names of files with them: .csv, .ply or .gpkg, in metres unless `scale` is "free".
    scale
        "metric" where both clouds are in metres, "free" where the ratio of their scales is unknown.
    method
        "verified", or "paper" for the published method.
    noise_m
        Standard deviation per axis of the difference of the two visits; None: estimated.
    up
        The vertical in the query's and in the map's frame, where it is known to some 5 degrees; a pose that leans by
        more than 10 is refused.
    per_frame
        Give each frame of the query a transform of its own and merge their pairs (paper only). The query must know
        which frame saw which fruit.
    config
        Values of the core's tables that differ from `default_config()`; unknown keys are errors.
    threads
        Threads of the search, from 1, of which no more than there are cores are used; None takes all. The answer does
        not depend on it.

    Raises
    ------
    PomonaError
        An array or a setting is wrong. That there is no match is no error: see `Match.status`.

    Warns
    -----
    PomonaWarning
        Where a cloud cannot be in metres, or its numbers go in steps as coarse as fruits are apart.
    """
    start = time.perf_counter()
    unit: Unit = "free" if scale == "free" else "m"
    query, map = as_cloud(query, unit, name="query"), as_cloud(map, unit, name="map")
    if unit == "m":
        doubt_metres("query", query)
        doubt_metres("map", map)
    index = Index(map, scale=scale, method=method, config=config, threads=threads)
    found = index.match(query, noise_m=noise_m, up=up, per_frame=per_frame)
    return replace(found, elapsed_s=time.perf_counter() - start)


class ReadyCloud:
    """A cloud made ready once for several of `match_expected`, as the query or as the map.

    Parameters
    ----------
    cloud
        A cloud, (N, 3) metres, or the name of a file with one.
    threads
        As for `match`.

    Raises
    ------
    PomonaError
        An array is wrong.
    """

    def __init__(self, cloud: Cloud, *, threads: int | None = None) -> None:
        self.cloud = as_cloud(cloud, "m")
        try:
            self._core = _core.ReadyCloud(core_arrays(self.cloud), threads=capped_threads(threads))
        except (ValueError, TypeError, OverflowError) as error:
            raise _named("cloud", error) from None

    def __len__(self) -> int:
        return len(self.cloud)

    def __repr__(self) -> str:
        return f"ReadyCloud({amount(len(self), 'fruit')})"


def match_expected(
    query: Cloud | ReadyCloud,
    map: Cloud | ReadyCloud,
    map_from_query: ArrayLike,
    *,
    noise_m: float | None = None,
    config: Mapping[str, Any] | None = None,
    threads: int | None = None,
) -> Match:
    """Do as `match` does by the verified method, metric, where the pose is known to a few decimetres, at half the cost.

    What is found follows from the two clouds alone: by how much the pose is off changes nothing. `NoMatch` where that
    leaves a doubt, or the two share little: then `match` says more.

    Parameters
    ----------
    query, map, noise_m, config, threads
        As for `match`, in metres; clouds that are asked about several times may be made ready once.
    map_from_query
        (4, 4), without a scale.

    Raises
    ------
    PomonaError
        An array or a setting is wrong.
    """
    start = time.perf_counter()
    pose, noise = given_pose(map_from_query), given_noise(noise_m)
    asked, known = (
        side if isinstance(side, ReadyCloud) else ReadyCloud(side, threads=threads) for side in (query, map)
    )
    try:
        found = _core.match_expected(
            asked._core,
            known._core,
            map_from_query=pose,
            config=core_settings(config),
            noise_m=noise,
            threads=capped_threads(threads),
        )
    except (ValueError, TypeError, OverflowError) as error:
        raise _named("match", error) from None
    return _told(found, len(asked), len(known), start)


def default_config() -> dict[str, Any]:
    """Return the core's settings with their defaults, a table per method."""
    defaults: dict[str, Any] = json.loads(_core.default_config())
    return defaults


def core_arrays(cloud: FruitCloud) -> _core._Arrays:
    """Return the arrays the core reads, contiguous."""
    views = cloud.views
    return {
        "positions": np.ascontiguousarray(cloud.positions, np.float64),
        "covariances": None if cloud.covariances is None else np.ascontiguousarray(cloud.covariances, np.float64),
        "diameters_m": None if cloud.diameters_m is None else np.ascontiguousarray(cloud.diameters_m, np.float64),
        "view_frames": None if views is None else np.ascontiguousarray(views.frames, np.int64),
        "view_fruits": None if views is None else np.ascontiguousarray(views.fruits, np.int64),
    }


def core_vertical(up: Up | None) -> tuple[list[float], list[float]] | None:
    """Return the vertical in the query and in the map as the core reads it; one direction holds for both."""
    if up is None:
        return None
    if np.ma.is_masked(up):
        raise PomonaError("up: found a masked array, expected one whose values are all known")
    try:
        vectors = np.asarray(up, np.float64)
    except (TypeError, ValueError, OverflowError):
        raise PomonaError("up: expected one direction, (3,), or two, (2, 3)") from None
    if vectors.shape == (3,):
        vectors = np.stack((vectors, vectors))
    if vectors.shape != (2, 3):
        raise PomonaError(f"up: found an array of shape {vectors.shape}, expected (3,) or (2, 3)")
    return vectors[0].tolist(), vectors[1].tolist()
