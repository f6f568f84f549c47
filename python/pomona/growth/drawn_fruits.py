"""Draws of all fruits together from the model of one curve: sizes on any day, rates, and who has stopped growing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from datetime import datetime

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from pomona.growth.chance import Chance, evenly_spread
from pomona.growth.fitting import N_NUMBERS
from pomona.growth.hierarchy import Effects, Hierarchy
from pomona.growth.stopped_fruits import four_numbers, kept_growth, stopped_growth
from pomona.growth.trust import Trust
from pomona.growth.weighing import WeighedCurve

__all__ = ["CAMERA_SPREAD", "DrawnFruits", "drawn_fruits"]

Numbers = NDArray[np.float64]

_SHARED_DOUBT = 0.4
"""Of the variance of the lots by which fruits hang, what all share: the chances of seeing and of going that a map
believes in are off for all of its fruits together.
With 0.4 the counts of nine in ten of 42 drawn rows are in their intervals; with none, of four in ten."""

_DRAWS, _LEAST_DRAWS = 512, 128
"""Of a curve that is sure, and of each, by weight."""

_LEAST_WEIGHT = 1e-6
"""Of a draw: what is believed less adds nothing but time."""

CAMERA_SPREAD = 0.03
"""Standard deviation of the logarithm of the scale that all visits share, as they share their camera: with nominal
intrinsics apples of `kinect_apples` were 8 % too large, with calibrated ones 2 %. The visits cannot tell it."""

_MAY_HAVE_STOPPED = 0.01
"""Probability from which on a fruit is drawn as stopped now and then; of others all draws grow."""

_A_DAY = 1.0
"""Over which the rate of the last visit is taken."""


@dataclass(frozen=True, eq=False)
class DrawnFruits:
    """One draw of N fruits at Q times.

    Attributes
    ----------
    weight : float
        The sum of a curve's is the belief in it.
    log_sizes : (N, Q)
        Logarithms of diameters in mm.
    relative_rates : (N,)
        Growth a day at the last visit, of the size.
    stopped : (N,) bool
        Which have stopped growing by then.
    errors : (S,)
        Of the scales of visits, logarithms.
    lots : (N,)
        Standard normal numbers, that say whether each fruit hangs.
    """

    weight: float
    log_sizes: Numbers
    relative_rates: Numbers
    stopped: NDArray[np.bool_]
    errors: Numbers
    lots: Numbers


def drawn_fruits(
    curve: WeighedCurve, belief: float, trust: Trust, moments: Sequence[datetime]
) -> Iterator[DrawnFruits]:
    """Draw the fruits again and again, in the order of the curve's table.

    Parameters
    ----------
    curve : WeighedCurve
    belief : float
        In the curve; none is drawn where it is 0.
    trust : Trust
    moments : sequence of Q datetime
        The visits, then later ones.
    """
    table, family = curve.table, curve.fitted.family
    times, n_visits = curve.clock.times(moments), len(table.times)
    per_day = curve.clock.per_day(moments[n_visits - 1])
    with_next_day = np.insert(times, n_visits, table.times[-1] + _A_DAY)
    chance = Chance(curve.name, _count(belief), N_NUMBERS + 1, n_visits)
    first = evenly_spread(f"{curve.name}: first", _DRAWS, N_NUMBERS + 1)
    shapes, weights = curve.fitted.weighed(first, chance.shapes) if belief else ((), np.empty(0))
    for shape, weight in zip(shapes, belief * weights, strict=True):
        chance.next_draw()
        if weight < _LEAST_WEIGHT:
            continue
        model = Hierarchy(table, family, shape)
        effects = model.draw(chance)
        strayed = model.draw_stray(effects, with_next_day, chance)
        strays_by = (strayed[n_visits] - strayed[n_visits - 1]) / _A_DAY
        sizes, onsets, stops, shares, kept = _own_numbers(model, effects, trust, strayed[:n_visits], chance)
        # The onset moves the curve itself here, not its tangent.
        growth = model.log_size(times - onsets[:, None]) + np.delete(strayed, n_visits)
        x = shape.rate_per_day * (table.times[-1] - onsets - shape.onset_day)
        rates = per_day * (shape.rate_per_day * family.slope(x) + strays_by)
        stopped = stops < n_visits
        growth[stopped] = stopped_growth(growth[stopped], stops[stopped], shares[stopped], kept[stopped])
        # Of one camera all sizes are too large alike. The mean takes that up: its prior is wide, so nothing else moves.
        camera = CAMERA_SPREAD * chance.shared("camera")[0]
        yield DrawnFruits(
            float(weight),
            (effects.mean - camera + effects.trees[table.trees] + sizes)[:, None] + growth,
            np.where(stopped, kept_growth(rates, kept), rates),
            stopped,
            effects.visits - strayed[:n_visits],
            np.sqrt(_SHARED_DOUBT) * chance.shared("hanging")[0]
            + np.sqrt(1.0 - _SHARED_DOUBT) * chance.single("hanging", len(sizes)),
        )


def _count(belief: float) -> int:
    """Part the draws by belief, in powers of two."""
    return max(_LEAST_DRAWS, 1 << int(np.ceil(np.log2(max(_DRAWS * belief, 1.0)))))


def _own_numbers(
    model: Hierarchy, effects: Effects, trust: Trust, strayed: Numbers, chance: Chance
) -> tuple[Numbers, Numbers, NDArray[np.int64], Numbers, Numbers]:
    """Draw sizes a, onsets o, after how many visits each stopped, and u and w of those that did, (N,) each.

    Of fruits that surely grow the numbers are those of the effects.
    """
    n, n_visits = model.table.logs.shape
    lots = ndtr(chance.single("stopping", n))[model.table.ranks]
    rows = np.flatnonzero(trust.stopped >= _MAY_HAVE_STOPPED)
    sizes, onsets, stops = effects.sizes.copy(), effects.onsets_days.copy(), np.full(n, n_visits)
    shares, kept = np.zeros((2, n))
    stops[rows] = (lots[rows, None] > trust.stops[rows].cumsum(axis=1)[:, :-1]).sum(axis=1)
    own = four_numbers(model, effects, strayed, rows, stops[rows], trust.in_size[rows, stops[rows]])
    noise = chance.single("own", 4 * n).reshape(4, -1)[:, model.table.ranks]
    sizes[rows], onsets[rows], shares[rows], kept[rows] = own.drawn(noise[:, rows].T).T
    return sizes, onsets, stops, shares, kept
