"""How identities over several visits compare with the truth."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence, Set
from dataclasses import dataclass, fields

Seen = tuple[int, int]
"""One sight of a fruit: its identity in the map, and the true fruit, 0 for a false point."""


@dataclass(frozen=True)
class IdentityScore:
    """Counts; scores of several seasons are pooled by adding them.

    Attributes
    ----------
    right, said, common
        Pairs of sights of two visits: of one identity and one fruit, of one identity, of one fruit.
    whole, tracked
        Fruits seen at least twice, and those of them that have one identity which has nothing else.
    gone_right, gone_said, gone_true, gone_wrong, living
        Fruits that the map says are gone and are, all that it says this of, all that are; those it says it of that
        hang, and all that hang. Only of fruits that were seen, false points left out.
    """

    right: int = 0
    said: int = 0
    common: int = 0
    whole: int = 0
    tracked: int = 0
    gone_right: int = 0
    gone_said: int = 0
    gone_true: int = 0
    gone_wrong: int = 0
    living: int = 0

    def __add__(self, other: "IdentityScore") -> "IdentityScore":
        return IdentityScore(*(getattr(self, field.name) + getattr(other, field.name) for field in fields(self)))

    def shares(self) -> dict[str, float | None]:
        """Return the figures of the tables; None where nothing was asked."""
        return {
            "P": _share(self.right, self.said),
            "R": _share(self.right, self.common),
            "whole_of_tracked": _share(self.whole, self.tracked),
            "gone_recall": _share(self.gone_right, self.gone_true),
            "gone_precision": _share(self.gone_right, self.gone_said),
            "living_said_gone": _share(self.gone_wrong, self.living),
        }


def score_identities(
    visits: Sequence[Sequence[Seen]], said_gone: Set[int] = frozenset(), truly_gone: Set[int] = frozenset()
) -> IdentityScore:
    """Compare the sights of all visits, in the order of their dates, with the truth."""
    sights = [seen for visit in visits for seen in visit]
    by_identity, by_fruit = defaultdict(Counter), defaultdict(Counter)
    for identity, fruit in sights:
        by_identity[identity][fruit] += 1
        by_fruit[fruit][identity] += 1
    true_fruits = {fruit: identities for fruit, identities in by_fruit.items() if fruit}
    tracked = {fruit: identities for fruit, identities in true_fruits.items() if identities.total() > 1}
    whole = sum(len(own) == 1 and len(by_identity[next(iter(own))]) == 1 for own in tracked.values())
    last = {fruit: identity for identity, fruit in sights if fruit}
    return IdentityScore(
        right=_pairs(count for fruit, own in true_fruits.items() for count in own.values()),
        said=_pairs(own.total() for own in by_identity.values()),
        common=_pairs(own.total() for own in true_fruits.values()),
        whole=whole,
        tracked=len(tracked),
        **_gone(last, said_gone, truly_gone),
    )


def _gone(last: Mapping[int, int], said: Set[int], truly: Set[int]) -> dict[str, int]:
    """Count by the identity of each fruit's last sight."""
    said_of = {fruit for fruit, identity in last.items() if identity in said}
    return {
        "gone_right": len(said_of & truly),
        "gone_said": len(said_of),
        "gone_true": len(last.keys() & truly),
        "gone_wrong": len(said_of - truly),
        "living": len(last.keys() - truly),
    }


def _pairs(counts: Iterable[int]) -> int:
    return sum(count * (count - 1) // 2 for count in counts)


def _share(part: int, whole: int) -> float | None:
    return part / whole if whole else None
