"""What a row is asked to be: training system, cultivar, crop and foliage, with units in the names."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import date

from pomona.errors import PomonaError
from pomona.synth.living.cultivars import CULTIVARS, Cultivar
from pomona.synth.living.training_systems import SYSTEMS, TrainingSystem

__all__ = ["RowDesign"]

_MOST_TREES, _MOST_FRUITS, _MOST_LEAVES = 200, 1000, 20_000


@dataclass(frozen=True)
class RowDesign:
    """A row of trees over one season; the defaults are a spindle planting of Gala in July.

    Attributes
    ----------
    system, cultivar
        Names in `SYSTEMS` and `CULTIVARS`.
    n_trees
        Labelled trees; tree i stands at x = i * spacing.
    spacing_m, height_m
        Between trunks, and of a tree; 0 takes the system's own.
    bloom
        Full bloom; all of the season counts from this day.
    fruits_per_tree
        Fewest and most fruits that set on a tree and hang when labelling begins, in June.
    cluster_sizes
        Probability of a cluster of 1, 2, ... fruits.
    tree_spread, onset_spread_days
        Standard deviation of a tree's fruit size, as a share, and of the day a fruit begins to grow.
    june_drop_share, late_drop_share
        Share of the fruits that drop 35-55 days after bloom, and from then to the harvest.
    thinned_share, thinned_after_bloom_days
        Share of all fruits that is thinned that day, out of clusters that keep at least one.
    pickings
        (days after bloom, share of what hangs): the ripest are picked.
    leaves_per_tree, spurs_per_tree
        Leaves, half of them in rosettes on the spurs. A pruned tree in which half of the fruits can be seen has 3000 to
        4000, a full one 5000 to 10,000.
    leaf_length_m
        Mean length of a blade.
    softness
        Of the wood: branches sink so many times as far under their fruits as usual.
    row_behind, row_spacing_m
        Whether a row stands behind, at +y, unlabelled, and how far.
    grass_blades_per_m2
        Under the trees; 0 leaves the ground bare.
    clear_of_posts
        Whether fruits hang beside posts and wires; else some stand in them, as in rows that were drawn before this
        could be asked. All other fruits are the same.
    """

    system: str = "spindle"
    cultivar: str = "gala"
    n_trees: int = 5
    spacing_m: float = 0.0
    height_m: float = 0.0
    bloom: date = date(2024, 4, 25)
    fruits_per_tree: tuple[int, int] = (80, 120)
    cluster_sizes: tuple[float, ...] = (0.35, 0.35, 0.2, 0.1)
    tree_spread: float = 0.02
    onset_spread_days: float = 2.5
    june_drop_share: float = 0.1
    late_drop_share: float = 0.04
    thinned_share: float = 0.0
    thinned_after_bloom_days: int = 60
    pickings: tuple[tuple[int, float], ...] = ()
    leaves_per_tree: int = 3600
    spurs_per_tree: int = 420
    leaf_length_m: float = 0.066
    softness: float = 1.0
    row_behind: bool = True
    row_spacing_m: float = 3.3
    grass_blades_per_m2: float = 60.0
    clear_of_posts: bool = True

    def __post_init__(self) -> None:
        _require_known("system", self.system, SYSTEMS)
        _require_known("cultivar", self.cultivar, CULTIVARS)
        for name, low, high in _LIMITS:
            _require_within(name, getattr(self, name), low, high)
        least, most = self.fruits_per_tree
        if not 0 <= least <= most <= _MOST_FRUITS:
            raise PomonaError(
                f"fruits_per_tree: found {least} to {most}, expected 0 <= least <= most <= {_MOST_FRUITS}"
            )
        if not self.cluster_sizes or min(self.cluster_sizes) < 0 or abs(sum(self.cluster_sizes) - 1.0) > 1e-9:
            raise PomonaError(f"cluster_sizes: found {self.cluster_sizes}, expected probabilities that sum to 1")
        for day, share in self.pickings:
            _require_within("pickings: day after bloom", day, 0, 365)
            _require_within("pickings: share", share, 0.0, 1.0)

    @property
    def training(self) -> TrainingSystem:
        """The training system, with this design's spacing and height."""
        return SYSTEMS[self.system].resized(self.spacing_m, self.height_m)

    @property
    def apple(self) -> Cultivar:
        """The cultivar."""
        return CULTIVARS[self.cultivar]


_LIMITS = (
    ("n_trees", 1, _MOST_TREES),
    ("spacing_m", 0.0, 10.0),
    ("height_m", 0.0, 8.0),
    ("tree_spread", 0.0, 0.3),
    ("onset_spread_days", 0.0, 20.0),
    ("june_drop_share", 0.0, 1.0),
    ("late_drop_share", 0.0, 1.0),
    ("thinned_share", 0.0, 1.0),
    ("thinned_after_bloom_days", 0, 365),
    ("leaves_per_tree", 0, _MOST_LEAVES),
    ("spurs_per_tree", 1, 5000),
    ("leaf_length_m", 0.01, 0.3),
    ("softness", 0.0, 20.0),
    ("row_spacing_m", 2.0, 20.0),
    ("grass_blades_per_m2", 0.0, 2000.0),
)


def _require_known(name: str, found: str, known: dict[str, TrainingSystem] | dict[str, Cultivar]) -> None:
    if found not in known:
        raise PomonaError(f"{name}: found {found!r}, expected one of {', '.join(known)}")


def _require_within(name: str, found: float, low: float, high: float) -> None:
    if not low <= found <= high:  # NaN is in no range
        raise PomonaError(f"{name}: found {found}, expected {low} to {high}")
