from typing import TypedDict, final

import numpy as np
from numpy.typing import NDArray

__all__ = ["MapIndex", "Match", "__version__", "default_config", "describe"]

__version__: str

class _Arrays(TypedDict):
    positions: NDArray[np.float64]
    covariances: NDArray[np.float64] | None
    diameters_m: NDArray[np.float64] | None
    view_frames: NDArray[np.int64] | None
    view_fruits: NDArray[np.int64] | None

@final
class Match:
    @property
    def status(self) -> str: ...
    @property
    def map_from_query(self) -> NDArray[np.float64] | None: ...
    @property
    def scale(self) -> float | None: ...
    @property
    def log_odds(self) -> float | None: ...
    @property
    def alternatives(self) -> list[tuple[list[list[float]], float]]: ...
    @property
    def pairs(self) -> NDArray[np.int64]: ...
    @property
    def probabilities(self) -> NDArray[np.float64]: ...
    @property
    def distances_m(self) -> NDArray[np.float64]: ...
    @property
    def support(self) -> NDArray[np.float64]: ...
    @property
    def noise_m(self) -> float: ...
    @property
    def stages(self) -> list[tuple[str, float]]: ...

@final
class MapIndex:
    def __new__(cls, map: _Arrays, *, method: str, scale: str, config: str, threads: int | None = None) -> MapIndex: ...
    def search(
        self,
        query: _Arrays,
        *,
        noise_m: float | None = None,
        up: tuple[list[float], list[float]] | None = None,
        per_frame: bool = False,
    ) -> Match: ...
    def pairs_under(
        self, query: _Arrays, *, map_from_query: list[list[float]], noise_m: float | None = None
    ) -> Match: ...

def default_config() -> str: ...
def describe(positions: NDArray[np.float64], k: int, n: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]: ...
