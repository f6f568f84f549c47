from collections.abc import Sequence
from os import PathLike
from typing import Protocol, Self, TypedDict, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "MOST_MISALIGNED",
    "Localization",
    "Localizer",
    "Looking",
    "MapIndex",
    "Match",
    "Odometry",
    "ReadyCloud",
    "RowScene",
    "Threads",
    "Tracker",
    "Tracks",
    "__version__",
    "adjust",
    "believed",
    "contracted",
    "default_config",
    "describe",
    "exposure_gains",
    "exposure_tables",
    "fuse_fruits",
    "lift",
    "look_of",
    "match_expected",
    "one_fruit_each",
    "read_pair",
    "rejoin",
    "row_alignment",
    "row_reach_px",
    "setting_meanings",
    "whereabouts",
]

MOST_MISALIGNED: tuple[float, float]
__version__: str

class _Arrays(TypedDict):
    positions: NDArray[np.float64]
    covariances: NDArray[np.float64] | None
    diameters_m: NDArray[np.float64] | None
    view_frames: NDArray[np.int64] | None
    view_fruits: NDArray[np.int64] | None

class _Camera(Protocol):
    @property
    def width(self) -> int: ...
    @property
    def height(self) -> int: ...
    @property
    def fx(self) -> float: ...
    @property
    def fy(self) -> float: ...
    @property
    def cx(self) -> float: ...
    @property
    def cy(self) -> float: ...
    @property
    def baseline_m(self) -> float | None: ...

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
    def further(self) -> list[list[list[float]]]: ...
    @property
    def pairs(self) -> NDArray[np.int64]: ...
    @property
    def part_of_pairs(self) -> NDArray[np.int64]: ...
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
    @staticmethod
    def compact(map: _Arrays, *, config: str, threads: int | None = None) -> MapIndex: ...
    @staticmethod
    def opened(path: str | PathLike[str], map: _Arrays, *, config: str, threads: int | None = None) -> MapIndex: ...
    def save(self, path: str | PathLike[str]) -> None: ...
    @property
    def is_compact(self) -> bool: ...
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

@final
class ReadyCloud:
    def __new__(cls, cloud: _Arrays, *, threads: int | None = None) -> ReadyCloud: ...

def match_expected(
    query: ReadyCloud,
    map: ReadyCloud,
    *,
    map_from_query: list[list[float]],
    config: str,
    noise_m: float | None = None,
    threads: int | None = None,
) -> Match: ...

@final
class Localization:
    @property
    def status(self) -> str: ...
    @property
    def map_from_camera(self) -> NDArray[np.float64] | None: ...
    @property
    def covariance(self) -> NDArray[np.float64]: ...
    @property
    def pairs(self) -> NDArray[np.int64]: ...
    @property
    def probabilities(self) -> NDArray[np.float64]: ...
    @property
    def log_odds(self) -> float: ...
    @property
    def tracked(self) -> bool: ...

@final
class Threads:
    def __new__(cls, count: int) -> Threads: ...
    @property
    def count(self) -> int: ...

@final
class Localizer:
    def __new__(cls, map: _Arrays, *, config: str, threads: Threads | None = None) -> Localizer: ...
    @staticmethod
    def opened(
        path: str | PathLike[str], map: _Arrays, *, config: str, threads: Threads | None = None
    ) -> Localizer: ...
    def locate(self, seen: _Arrays, *, up: tuple[list[float], list[float]] | None = None) -> Localization: ...
    def update(
        self,
        seen: _Arrays,
        *,
        previous_from_camera: NDArray[np.float64] | None = None,
        motion_covariance: list[list[float]] | None = None,
        up: tuple[list[float], list[float]] | None = None,
    ) -> Localization: ...
    def reset(self) -> None: ...

class _Fruits(Protocol):
    @property
    def ids(self) -> NDArray[np.int64]: ...
    @property
    def centres_m(self) -> NDArray[np.float64]: ...
    @property
    def diameters_m(self) -> NDArray[np.float64]: ...
    @property
    def heights_m(self) -> NDArray[np.float64]: ...
    @property
    def axes(self) -> NDArray[np.float64]: ...
    @property
    def ground_colours(self) -> NDArray[np.float64]: ...
    @property
    def blush_colours(self) -> NDArray[np.float64]: ...
    @property
    def blush_shares(self) -> NDArray[np.float64]: ...
    @property
    def blush_directions(self) -> NDArray[np.float64]: ...

class _Limbs(Protocol):
    @property
    def starts_m(self) -> NDArray[np.float64]: ...
    @property
    def ends_m(self) -> NDArray[np.float64]: ...
    @property
    def start_radii_m(self) -> NDArray[np.float64]: ...
    @property
    def end_radii_m(self) -> NDArray[np.float64]: ...
    @property
    def colours(self) -> NDArray[np.float64]: ...

class _Leaves(Protocol):
    @property
    def bases_m(self) -> NDArray[np.float64]: ...
    @property
    def tips(self) -> NDArray[np.float64]: ...
    @property
    def normals(self) -> NDArray[np.float64]: ...
    @property
    def lengths_m(self) -> NDArray[np.float64]: ...
    @property
    def widths_m(self) -> NDArray[np.float64]: ...
    @property
    def folds_rad(self) -> NDArray[np.float64]: ...
    @property
    def bends_rad(self) -> NDArray[np.float64]: ...
    @property
    def colours(self) -> NDArray[np.float64]: ...

class _Geometry(Protocol):
    @property
    def fruits(self) -> _Fruits: ...
    @property
    def limbs(self) -> _Limbs: ...
    @property
    def leaves(self) -> _Leaves: ...

class _Weather(Protocol):
    @property
    def sun_elevation_rad(self) -> float: ...
    @property
    def sun_azimuth_rad(self) -> float: ...
    @property
    def sun_strength(self) -> float: ...
    @property
    def sun_colour(self) -> tuple[float, float, float]: ...
    @property
    def sky_colour(self) -> tuple[float, float, float]: ...
    @property
    def horizon_colour(self) -> tuple[float, float, float]: ...
    @property
    def wind_m(self) -> float: ...

@final
class RowScene:
    def __new__(
        cls,
        geometry: _Geometry,
        camera: _Camera,
        session_from_camera: NDArray[np.float64],
        weather: _Weather,
        *,
        seed: int,
    ) -> Self: ...
    def pair(
        self, session_from_camera: NDArray[np.float64], frame: int
    ) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.float32], NDArray[np.uint16]]: ...

class _Lifted(TypedDict):
    rows: NDArray[np.int64]
    centres_in_camera: NDArray[np.float64]
    covariances: NDArray[np.float64]
    diameters_m: NDArray[np.float64]
    diameter_sigmas_m: NDArray[np.float64]
    support: NDArray[np.float64]

@final
class Tracker:
    def __new__(cls, camera: _Camera, *, config: str) -> Tracker: ...
    def update(
        self,
        frame: int,
        session_from_camera: NDArray[np.float64],
        boxes_px: NDArray[np.float64],
        scores: NDArray[np.float64],
        lifted: _Lifted,
    ) -> NDArray[np.int64]: ...
    def glimpse(self, picture: NDArray[np.uint8]) -> None: ...
    @property
    def min_views(self) -> int: ...
    def finish(self, min_views: int | None = None) -> Tracks: ...

class _TrackViews(TypedDict):
    centres: NDArray[np.float64]
    depths_m: NDArray[np.float64]
    views: NDArray[np.int64]
    glimpses: NDArray[np.int64]
    shown_m2: NDArray[np.float64]
    fruitness: NDArray[np.float64]
    diameters_m: NDArray[np.float64]
    diameter_sigmas_m: NDArray[np.float64]
    missed_boxes: float

@final
class Tracks:
    @property
    def numbers(self) -> NDArray[np.int64]: ...
    @property
    def centres(self) -> NDArray[np.float64]: ...
    @property
    def covariances(self) -> NDArray[np.float64]: ...
    @property
    def radii_m(self) -> NDArray[np.float64]: ...
    @property
    def radius_sigmas_m(self) -> NDArray[np.float64]: ...
    @property
    def n_views(self) -> NDArray[np.int64]: ...
    @property
    def n_glimpses(self) -> NDArray[np.int64]: ...
    @property
    def missed_boxes(self) -> float: ...
    @property
    def evidence(self) -> NDArray[np.float64]: ...
    @property
    def frames(self) -> NDArray[np.int64]: ...
    @property
    def rows(self) -> NDArray[np.int64]: ...
    @property
    def fruits(self) -> NDArray[np.int64]: ...
    @property
    def shared(self) -> NDArray[np.bool_]: ...

def believed(
    tracks: _TrackViews,
    *,
    box_fruitness: NDArray[np.float64],
    elsewhere: NDArray[np.float64],
    camera: _Camera,
    poses: NDArray[np.float64],
    config: str,
) -> tuple[NDArray[np.float64], NDArray[np.bool_], float]: ...
def look_of(
    picture: NDArray[np.uint8], boxes_px: NDArray[np.float64]
) -> tuple[NDArray[np.uint8], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]: ...
def one_fruit_each(
    *,
    centres: NDArray[np.float64],
    covariances: NDArray[np.float64],
    radii_m: NDArray[np.float64],
    frames: NDArray[np.int64],
    fruits: NDArray[np.int64],
    place_sigma_m: float,
    config: str,
) -> NDArray[np.int64]: ...

@final
class Looking:
    def __new__(cls, config: str) -> Self: ...
    @property
    def settings(self) -> str: ...
    def corners(
        self, pictures: Sequence[NDArray[np.uint8]], taken: NDArray[np.float64], per_cell: int
    ) -> NDArray[np.float64]: ...
    def disparities(
        self,
        left: Sequence[NDArray[np.uint8]],
        right: Sequence[NDArray[np.uint8]],
        points: NDArray[np.float64],
        farthest_px: float,
    ) -> NDArray[np.float64]: ...
    def follow(
        self,
        first: Sequence[NDArray[np.uint8]],
        second: Sequence[NDArray[np.uint8]],
        points: NDArray[np.float64],
        expected: NDArray[np.float64],
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]: ...

class _Eyes(Protocol):
    def follow(
        self, from_px: NDArray[np.float64], expected_px: NDArray[np.float64], /
    ) -> tuple[NDArray[np.float64], NDArray[np.bool_]]: ...
    def find_again(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    def measure(
        self, known_px: NDArray[np.float64], disparities_px: NDArray[np.float64], per_cell: int, /
    ) -> NDArray[np.float64]: ...

_Motion = tuple[NDArray[np.float64] | None, int, str | None, str | None, int, bool]

@final
class Odometry:
    def __new__(cls, camera: _Camera, *, config: str) -> Self: ...
    @property
    def disparities_px(self) -> tuple[float, float]: ...
    def take(self, eyes: _Eyes) -> _Motion: ...
    def skip(self, reason: str) -> _Motion: ...
    def trajectory(
        self,
    ) -> tuple[
        NDArray[np.int64],
        NDArray[np.int64],
        NDArray[np.float64],
        NDArray[np.int64],
        NDArray[np.int64],
        NDArray[np.float64],
        NDArray[np.float64],
        float,
    ]: ...

_Places = tuple[NDArray[np.float64], NDArray[np.float64]]

def rejoin(
    before: _Places, part: _Places, *, last: NDArray[np.float64], step: list[float], first: NDArray[np.float64]
) -> NDArray[np.float64] | None: ...

class _Seen(TypedDict):
    poses: NDArray[np.int64]
    points: NDArray[np.int64]
    values: NDArray[np.float64]
    whitenings: NDArray[np.float64]

class _Between(TypedDict):
    first: NDArray[np.int64]
    second: NDArray[np.int64]
    first_from_second: NDArray[np.float64]
    information: NDArray[np.float64]
    doubtful: NDArray[np.bool_]

def adjust(
    poses: NDArray[np.float64],
    fixed: NDArray[np.bool_],
    points: NDArray[np.float64],
    *,
    places: _Seen,
    relative_poses: _Between | None,
    pose_covariances: bool = False,
) -> tuple[
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64] | None,
]: ...
def default_config() -> str: ...
def setting_meanings() -> dict[str, str]: ...
def contracted(
    visits: NDArray[np.int64],
    n_visits: int,
    links: NDArray[np.int64],
    log_odds: NDArray[np.float64],
    matched: NDArray[np.int64],
    against: NDArray[np.float64],
) -> NDArray[np.int64]: ...
def whereabouts(map: NDArray[np.float64], visit: NDArray[np.float64]) -> tuple[list[list[float]], int] | None: ...
def describe(positions: NDArray[np.float64], k: int, n: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]: ...

class _Sightings(TypedDict):
    frames: NDArray[np.int64]
    fruits: NDArray[np.int64]
    centres_in_camera: NDArray[np.float64]
    covariances: NDArray[np.float64]
    diameters_m: NDArray[np.float64]
    diameter_sigmas_m: NDArray[np.float64]
    hidden: NDArray[np.float64]

def fuse_fruits(
    sightings: _Sightings, session_from_camera: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]: ...
def lift(
    depth_m: NDArray[np.float32],
    boxes_px: NDArray[np.float64],
    sources: NDArray[np.float64],
    camera: _Camera,
) -> tuple[NDArray[np.uint8], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]: ...
def read_pair(
    left: NDArray[np.uint8],
    right: NDArray[np.uint8],
    boxes_px: NDArray[np.float64],
    camera: _Camera,
    *,
    nearest_m: float,
) -> tuple[NDArray[np.float32], NDArray[np.float64]]: ...
def exposure_gains(picture: NDArray[np.uint8], reference: NDArray[np.uint8]) -> list[float]: ...
def exposure_tables(picture: NDArray[np.uint8], reference: NDArray[np.uint8]) -> NDArray[np.uint8] | None: ...
def row_alignment(
    corners: NDArray[np.float64], centre_px: tuple[float, float]
) -> tuple[float, float, bool, bool] | None: ...
def row_reach_px(width: int) -> int: ...
