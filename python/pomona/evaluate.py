"""Scores against truth: two fruits are one where they have the same true id."""

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

from pomona.errors import PomonaError


@dataclass(frozen=True)
class PairScore:
    """How the pairs of a match compare with the truth.

    Attributes
    ----------
    true, false
        Pairs of one fruit, and of two different fruits.
    missed
        Fruits that are in both clouds and got no right pair.
    unjudged
        Pairs with a side whose true id is empty; they count neither way.
    """

    true: int
    false: int
    missed: int
    unjudged: int = 0

    @property
    def common(self) -> int:
        """Fruits that are in both clouds."""
        return self.true + self.missed

    @property
    def precision(self) -> float | None:
        """Share of the judged pairs that are right; None where there are no pairs."""
        judged = self.true + self.false
        return self.true / judged if judged else None

    @property
    def recall(self) -> float | None:
        """Share of the common fruits that were found again; None where no fruit is in both clouds."""
        return self.true / self.common if self.common else None

    def __add__(self, other: "PairScore") -> "PairScore":
        """Pool the counts of two matches."""
        return PairScore(
            self.true + other.true,
            self.false + other.false,
            self.missed + other.missed,
            self.unjudged + other.unjudged,
        )


def score_pairs(
    pairs: Iterable[tuple[int, int]],
    truth_in_query: Sequence[str],
    truth_in_map: Sequence[str],
) -> PairScore:
    """Compare pairs of rows with the true ids of the rows.

    Parameters
    ----------
    pairs
        Row in the query and row in the map of each pair.
    truth_in_query, truth_in_map
        True id of each row; the same id means the same fruit, an empty one that the fruit is not known.

    Raises
    ------
    PomonaError
        An id names two rows of one cloud, or a pair names a row that does not exist.
    """
    for side, truth in (("query", truth_in_query), ("map", truth_in_map)):
        _refuse_repeats(side, truth)
    return _scored(pairs, truth_in_query, truth_in_map)


def score_placed_pairs(
    pairs: Iterable[tuple[int, int]],
    truth_in_query: Sequence[str],
    truth_in_map: Sequence[str],
) -> PairScore:
    """Compare pairs of rows with the true fruits that the rows lie at, as `pomona.truth.true_fruits` tells them.

    Two rows may lie at one fruit: either is right. A row that lies at none is a false fruit, and so is every pair of
    it.

    Parameters
    ----------
    pairs
        Row in the query and row in the map of each pair.
    truth_in_query, truth_in_map
        True id of each row, empty where it lies at no true fruit.

    Raises
    ------
    PomonaError
        A pair names a row that does not exist.
    """
    scored = _scored(pairs, truth_in_query, truth_in_map)
    return replace(scored, false=scored.false + scored.unjudged, unjudged=0)


def _scored(pairs: Iterable[tuple[int, int]], truth_in_query: Sequence[str], truth_in_map: Sequence[str]) -> PairScore:
    true: set[str] = set()
    false = unjudged = 0
    for query_row, map_row in pairs:
        in_query = _truth_of(query_row, "query", truth_in_query)
        in_map = _truth_of(map_row, "map", truth_in_map)
        if not (in_query and in_map):
            unjudged += 1
        elif in_query == in_map:
            true.add(in_query)
        else:
            false += 1
    common = (set(truth_in_query) & set(truth_in_map)) - {""}
    return PairScore(true=len(true), false=false, missed=len(common - true), unjudged=unjudged)


def _refuse_repeats(side: str, truth: Sequence[str]) -> None:
    for name, times in Counter(filter(None, truth)).items():
        if times > 1:
            raise PomonaError(f"{side}: id {name!r} names {times} fruits, expected one true id per fruit")


def _truth_of(row: int, side: str, truth: Sequence[str]) -> str:
    if not 0 <= row < len(truth):
        raise PomonaError(f"pair names row {row} of the {side}, found {len(truth)} rows")
    return truth[row]
