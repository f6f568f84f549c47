"""A map made ready once for many queries."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, get_args

from numpy.typing import ArrayLike

from pomona import _core
from pomona.amounts import amount
from pomona.answer import Match, Verdict, told_by_core
from pomona.atomic import whole_file
from pomona.cards import as_card
from pomona.cloud import Cloud, Unit, as_cloud
from pomona.cloud.given import doubt_metres, is_array
from pomona.core_clouds import core_arrays, refused_by_core
from pomona.core_settings import core_settings
from pomona.errors import PomonaError
from pomona.file_names import given_path
from pomona.kept_index import out_of_index
from pomona.likes import INDEX
from pomona.match_arguments import Method, Scale, Up, core_vertical, given_flag, given_noise, given_pose
from pomona.outputs import Output, require_outputs
from pomona.threads import capped_threads

__all__ = ["Index"]


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
            raise refused_by_core("map", error) from None

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
            raise refused_by_core("query", error) from None
        if found.status == Verdict.NO_MATCH and self._unit != "free":
            for name, asked, of_array in (("query", cloud, is_array(query)), ("map", self._map, self._of_array)):
                if of_array:  # looked at only now, for it takes longer than many a search
                    doubt_metres(name, asked)
        return told_by_core(found, len(cloud), len(self._map), start)
