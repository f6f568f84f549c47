"""A match whose pose is known to a few decimetres, at half the cost; clouds made ready for several of them."""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Any

from numpy.typing import ArrayLike

from pomona import _core
from pomona.amounts import amount
from pomona.answer import Match, told_by_core
from pomona.cloud import Cloud, as_cloud
from pomona.core_clouds import core_arrays, refused_by_core
from pomona.core_settings import core_settings
from pomona.match_arguments import given_noise, given_pose
from pomona.threads import capped_threads

__all__ = ["ReadyCloud", "match_expected"]


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
            raise refused_by_core("cloud", error) from None

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
        raise refused_by_core("match", error) from None
    return told_by_core(found, len(asked), len(known), start)
