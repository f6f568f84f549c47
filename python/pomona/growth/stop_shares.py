r"""Of a hundred fruits of a tree, how many stopped growing after each visit: a share that is learned tree by tree.

What stops fruits stops those of a tree, as a drought that reaches its roots, or fruits here and there, as frost and
insects do. So each tree has its own shares $\pi_{tz}$ of fruits that stopped after $z$ visits, learned as if of five
fruits that are as the row's; and the row's are learned as if of a hundred fruits of which one had stopped, on each day
as likely. One share for the whole row would ask of each fruit of a dry tree why it of all has stopped, and half a row
of them were sooner a wrong curve than 150 chances.

A stop teaches where it shows, on two sizes from then on. What grew less up to the last visit may have stopped, but
most such fruits grow a little less: learned of these too, the shares climb to a quarter where none stops, as the curve
of those that are left is the steeper.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import rel_entr

from pomona.growth.size_table import SizeTable

__all__ = ["StopShares"]

Numbers = NDArray[np.float64]

_STOPPED, _LOOKED_AT = 1.0, 100.0
"""What is known of the share of fruits that have stopped before any is measured: of a hundred one had."""

_ALIKE = 5.0
"""By how many fruits as the row's the shares of a tree are known before any of its own is measured."""

_BEFORE_DAYS = 10.0
"""From which day before the first visit on a fruit may have stopped: the onset of growth."""


@dataclass(frozen=True, eq=False)
class StopShares:
    """Shares of fruits that stopped after so many of S visits, 0 to S; the last is that they still grow.

    Attributes
    ----------
    row : (S + 1,)
    trees : (T, S + 1)
    """

    row: Numbers
    trees: Numbers

    @classmethod
    def before(cls, table: SizeTable, share: float = _STOPPED / _LOOKED_AT) -> StopShares:
        """Believe in a share, in all trees alike."""
        row = _over_days(table.times, share)
        return cls(row, np.tile(row, (len(table.tree_starts), 1)))

    @classmethod
    def learned(cls, table: SizeTable, stops: Numbers, are_fruits: Numbers) -> StopShares:
        """Learn them of fruits that stopped by chances, (N, S + 1), and are fruits by others, (N,)."""
        sizes_from = np.cumsum(table.seen[:, ::-1], axis=1)[:, ::-1]
        shows = np.pad(sizes_from > 1, ((0, 0), (0, 1))) * are_fruits[:, None]
        stopped, looked_at = shows * stops, shows @ np.append(_days(table.times), 0.0)
        share = float((stopped.sum() + _STOPPED) / (looked_at.sum() + _LOOKED_AT))
        row = _over_days(table.times, share)
        of_trees = np.add.reduceat(stopped, table.tree_starts) + _ALIKE * row
        of_trees /= (np.add.reduceat(shows[:, 0], table.tree_starts) + _ALIKE)[:, None]
        of_trees[:, -1] = 1.0 - of_trees[:, :-1].sum(axis=1)
        return cls(row, of_trees)

    def log_prior(self) -> float:
        """Logarithm of their density before any fruit is measured, but for what does not depend on them."""
        grow = float(self.row[-1])
        of_row = _STOPPED * np.log1p(-grow) + (_LOOKED_AT - _STOPPED) * np.log(grow)
        return float(of_row - _ALIKE * rel_entr(self.row, self.trees).sum())


def _days(times: Numbers) -> Numbers:
    """Share of the days on which a fruit may stop before each visit, (S,)."""
    days = np.diff(times, prepend=times[0] - _BEFORE_DAYS)
    return np.asarray(days / days.sum())


def _over_days(times: Numbers, share: float) -> Numbers:
    return np.append(share * _days(times), 1.0 - share)
