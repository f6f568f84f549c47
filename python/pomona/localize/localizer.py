"""Where the camera is in a map, frame by frame: the face of the core's `localization`, which does the work."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np
from numpy.typing import ArrayLike, NDArray

from pomona import _core
from pomona.answer import Verdict
from pomona.arrays import definite_matrices, rigid_matrices
from pomona.cards import as_card
from pomona.cloud import Cloud, as_cloud
from pomona.core_clouds import core_arrays
from pomona.core_settings import core_settings
from pomona.core_threads import Threads, core_threads
from pomona.errors import PomonaError
from pomona.kept_index import out_of_index
from pomona.localize.map_fruits import hanging_rows
from pomona.map_index import Index
from pomona.match_arguments import Up, core_vertical

__all__ = ["Localization", "Localizer"]


@dataclass(frozen=True, eq=False, repr=False)
class Localization:
    """Where the camera is, or why nobody can say; true where it was found.

    Attributes
    ----------
    status : Verdict
        ``Found``; ``TooFew`` fruits to say; ``Ambiguous``, several poses are as good; ``NoMatch``, the fruits are not
        the map's.
    map_from_camera : (4, 4) float64 or None
        Takes points of the camera (x right, y down, z forward) into the map; None unless found.
    covariance : (6, 6) float64
        Of a step of the pose in the camera's own frame: x, y, z in metres, then turns about x, y, z in radians, so that
        the true pose is ``map_from_camera @ exp(step)``. NaN unless found.
    pairs : (M, 2) int64
        Row in the frame and row in the map of each fruit that was found again, one to one.
    probabilities : (M,) float64
        Probability that the two are one fruit.
    log_odds : float
        Evidence of the fruits for the pose against chance, nats; NaN where no fruit speaks for it.
    tracked : bool
        Whether the pose follows from the one before; else it was found from nothing.
    """

    status: Verdict
    map_from_camera: NDArray[np.float64] | None
    covariance: NDArray[np.float64]
    pairs: NDArray[np.int64]
    probabilities: NDArray[np.float64]
    log_odds: float
    tracked: bool

    def __bool__(self) -> bool:
        return self.status is Verdict.FOUND

    def __repr__(self) -> str:
        if not self:
            return f"Localization({self.status})"
        place = ", ".join(f"{value:.3f}" for value in self.position_m)
        return f"Localization({self.status} at {place} m, {len(self.pairs)} fruits, +- {1000 * self.sigma_m:.0f} mm)"

    @property
    def position_m(self) -> NDArray[np.float64]:
        """Place of the camera in the map, (3,); NaN unless found."""
        pose = self.map_from_camera
        return np.full(3, np.nan) if pose is None else np.asarray(pose[:3, 3])

    @property
    def sigma_m(self) -> float:
        """Standard deviation of the place, metres, all three axes together; NaN unless found."""
        return float(np.sqrt(np.trace(self.covariance[:3, :3])))


class Localizer:
    """A map in which a camera finds itself, and where it was last.

    Parameters
    ----------
    map : FruitCloud, OrchardMap, Session, array_like, str or Path
        The fruits, metres; of an orchard map each where it was last seen, without those that are gone.
    config : mapping, optional
        Values of the core's tables that differ from `pomona.default_config()`; `localization` and `verified` are used.
    threads : int or Threads, optional
        Threads of the search from nothing, at most one a core; what `pomona.core_threads.core_threads` gives, several
        maps share. The answer does not depend on it.
    index : str or Path, optional
        File for the index of a large map, which then opens at once: made where there is none, and made anew, with a
        `PomonaWarning`, where it is of another map or version, or damaged.

    Raises
    ------
    PomonaError
        The map or a setting is wrong; something else than an index lies in its place.
    """

    def __init__(
        self,
        map: Cloud,
        *,
        config: Mapping[str, Any] | None = None,
        threads: int | Threads | None = None,
        index: str | Path | None = None,
    ) -> None:
        if index is not None and not isinstance(index, str | Path):
            raise PomonaError(f"index: found {type(index).__name__}, expected the path of a file")
        cloud = as_cloud(map)
        self._rows, self._map_m = hanging_rows(cloud), cloud.positions
        hanging, settings, most = cloud.select(self._rows), core_settings(config), core_threads(threads)
        arrays = core_arrays(hanging)

        def make(path: Path) -> None:
            Index(hanging, config=config, threads=None if most is None else most.count, compact=True).save(path)

        def read(path: Path) -> _core.Localizer:
            return _core.Localizer.opened(path, arrays, config=settings, threads=most)

        try:
            if index is None:
                self._core = _core.Localizer(arrays, config=settings, threads=most)
            else:
                self._core = out_of_index(Path(index), read, make, absent=make)
        except (ValueError, TypeError, OverflowError) as error:
            # What is wrong with settings says so by itself.
            is_setting = str(error).startswith(("configuration:", "setting "))
            raise PomonaError(str(error) if is_setting else f"map: {error}") from None

    def __len__(self) -> int:
        return len(self._rows)

    def __repr__(self) -> str:
        return f"Localizer({len(self)} fruits)"

    @property
    def map_m(self) -> NDArray[np.float64]:
        """Places of the fruits of the map, (N, 3) metres, in the rows that pairs name."""
        return self._map_m

    def __reduce__(self) -> NoReturn:
        # A copy would share what `update` knows with the first.
        raise TypeError("a Localizer is not copied, nor pickled: make another of the same map")

    def _repr_html_(self) -> str:
        return as_card("Localizer", {"fruits": len(self)})

    def locate(self, cloud: Cloud, *, up: Up | None = None) -> Localization:
        """Find the camera from one frame and nothing else; what `update` knows stays as it is.

        Parameters
        ----------
        cloud : FruitCloud, array_like, str or Path
            Fruits in the camera's frame, metres; with covariances where they are known, as `pomona.lift` gives them.
        up : optional
            The vertical in the camera's and in the map's frame, where it is known to some 5 degrees. Fruits are thought
            to sink then rather than to move aside, which the covariance says.

        Raises
        ------
        PomonaError
            An array is wrong, or another thread is in `update` right now. That the camera is not found is no error: see
            `Localization.status`.
        """
        arrays, vertical = core_arrays(as_cloud(cloud)), core_vertical(up)
        with _refusing():
            return self._answer(self._core.locate(arrays, up=vertical))

    def update(
        self,
        cloud: Cloud,
        moved: ArrayLike | None = None,
        *,
        covariance: ArrayLike | None = None,
        up: Up | None = None,
    ) -> Localization:
        """Find the camera with what is known from the frames before.

        Parameters
        ----------
        cloud : FruitCloud, array_like, str or Path
            As in `locate`; it may be empty.
        moved : (4, 4) array_like, optional
            The camera's pose now in the frame of the camera at the last call, where odometry tells it; else it is
            thought to move on as it did.
        covariance : (6, 6) array_like, optional
            Of `moved`, as `Localization.covariance`: of a step of the camera in its own frame now, metres and radians.
            Else what is usual: half a centimetre and 2 % of the way in each axis, 0.3 degrees.
        up : optional
            As in `locate`; to find the camera it is used from nothing only.

        Raises
        ------
        PomonaError
            As in `locate`.
        """
        arrays, vertical = core_arrays(as_cloud(cloud)), core_vertical(up)
        step, spread = _checked_motion(moved, covariance)
        with _refusing():
            found = self._core.update(arrays, previous_from_camera=step, motion_covariance=spread, up=vertical)
            return self._answer(found)

    def reset(self) -> None:
        """Forget where the camera was: the next update starts from nothing.

        Raises
        ------
        PomonaError
            Another thread uses the localizer right now.
        """
        with _refusing():
            self._core.reset()

    def _answer(self, found: _core.Localization) -> Localization:
        pairs = found.pairs
        return Localization(
            status=Verdict(found.status),
            map_from_camera=found.map_from_camera,
            covariance=found.covariance,
            pairs=np.stack((pairs[:, 0], self._rows[pairs[:, 1]]), axis=1),
            probabilities=found.probabilities,
            log_odds=found.log_odds,
            tracked=found.tracked,
        )


@contextmanager
def _refusing() -> Iterator[None]:
    """Say in one line what the core refuses."""
    try:
        yield
    except RuntimeError:
        # The one that the core raises: it is borrowed by another call.
        raise PomonaError("localizer: another thread uses it, expected one thread at a time") from None
    except (ValueError, TypeError, OverflowError) as error:
        is_named = str(error).startswith(("moved:", "up:"))
        raise PomonaError(str(error) if is_named else f"frame: {error}") from None


def _checked_motion(
    moved: ArrayLike | None, covariance: ArrayLike | None
) -> tuple[NDArray[np.float64] | None, list[list[float]] | None]:
    """Give the motion and its covariance, exactly symmetric, as the core takes them."""
    if moved is None and covariance is not None:
        raise PomonaError("covariance: found one without moved, expected that of a motion")
    step = None if moved is None else rigid_matrices("moved", moved)
    if covariance is None:
        return step, None
    spread = definite_matrices("covariance", covariance, (6, 6))
    return step, (0.5 * (spread + spread.T)).tolist()
