"""The named test cells: what two visits to a row share and how much disturbs them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from pomona.synth.planting import RowShape

Scene = Literal["row", "twins", "grid", "plane", "six"]


_APPLE_ROW = RowShape()


@dataclass(frozen=True)
class Cell:
    """One test condition.

    Attributes
    ----------
    name
        Also seeds the generator, so that cells are independent of one another.
    seen, shared
        Trees that each visit sees; trees that both see.
    hidden
        Probability that a visit misses a fruit.
    false_rate
        False points as a fraction of the fruits seen.
    noise_m
        Relative noise of the two visits, one sigma per axis; each visit gets noise_m / sqrt(2).
    sag_m
        Amplitude by which branches sink between the visits.
    scale_range
        The query is in units of 1 / s metres, s log-uniform in this range; None: both in metres.
    upright
        Both visits know the vertical: they are turned about z alone.
    sizes
        Both visits know the diameters, to 2 mm, the second after a common growth.
    growth
        Smallest and largest factor by which each diameter grows, log-uniform; None: 12 mm for all.
    drift
        Share of its length by which the second visit is stretched and bent.
    thinned
        Probability that a cluster is gone on the second visit.
    picked
        Probability that a fruit is gone on the second visit, each for itself.
    replanted
        Probability that a tree has given way to another before the second visit; one at least stands.
    tear_m
        How far the second visit is off in the last third of the row, where its camera lost the way; 0: nowhere.
    fade_m
        Depth over which sight fades, the visits looking from opposite sides; 0: both see alike.
    depth_noise
        Noise along the line of sight, in units of `noise_m`.
    doubled
        Share of the fruits that a visit has twice, and that it tries to take for one with their nearest.
    frame
        Fruits of the second visit that one frame shows; 0: all.
    mirrored
        The query is reflected, which no motion undoes.
    scene
        How the fruits hang.
    row
        Statistics of the row.
    seeded_as
        Cell whose fruits and disturbances this one repeats; empty: its own.
    right_answers
        Verdicts that are right. `Found` is right only with the right pose; without `Found` any pose is a false answer.
    """

    name: str
    seen: int = 5
    shared: int = 5
    hidden: float = 0.30
    false_rate: float = 0.05
    noise_m: float = 0.02
    sag_m: float = 0.0
    scale_range: tuple[float, float] | None = None
    upright: bool = False
    sizes: bool = False
    growth: tuple[float, float] | None = None
    drift: float = 0.0
    thinned: float = 0.0
    picked: float = 0.0
    replanted: float = 0.0
    tear_m: float = 0.0
    fade_m: float = 0.0
    depth_noise: float = 1.0
    doubled: float = 0.0
    frame: int = 0
    mirrored: bool = False
    scene: Scene = "row"
    row: RowShape = _APPLE_ROW
    seeded_as: str = ""
    right_answers: tuple[str, ...] = ("Found",)

    @property
    def scale(self) -> Literal["metric", "free"]:
        """The `scale` that a matcher may assume."""
        return "metric" if self.scale_range is None else "free"

    @property
    def has_answer(self) -> bool:
        """Whether a pose exists that a matcher should find."""
        return "Found" in self.right_answers


_NO_ANSWER = ("NoMatch", "TooFew", "Ambiguous")
_FREE = (0.5, 2.0)

_BASE = Cell("base")
_PART45 = Cell("part45", shared=2, hidden=0.45, false_rate=0.10)
_PART1 = Cell("part1", shared=1)
_PART1O45 = Cell("part1o45", shared=1, hidden=0.45, false_rate=0.10)
_NOOV = Cell("noov", shared=0, right_answers=_NO_ANSWER)
_O45S4 = Cell("o45s4", hidden=0.45, false_rate=0.10, noise_m=0.04)

PAPER_CELLS = (
    _BASE,
    _O45S4,
    replace(_O45S4, name="o45s8", noise_m=0.08),
    replace(_BASE, name="sag8", sag_m=0.08),
    _PART45,
    _PART1,
    _PART1O45,
    replace(_BASE, name="sim3", scale_range=_FREE),
    _NOOV,
    Cell("big5k", seen=48, shared=48, hidden=0.10),
)
"""The cells that published matchers were measured on."""

VARIANT_CELLS = (
    replace(_PART1, name="part1sim3", scale_range=_FREE),
    replace(_PART1O45, name="part1o45up", upright=True, seeded_as="part1o45"),
    replace(_NOOV, name="noovsim3", scale_range=_FREE),
    replace(_O45S4, name="o45s4size", sizes=True, seeded_as="o45s4"),
)
"""The same with something known or unknown besides."""

ROWS = {
    "wide": RowShape(spacing_m=2.5, reach_along_m=1.1, reach_depth_m=0.9),
    "single": RowShape(cluster_sizes=(1.0,)),
    "wall": RowShape(spacing_m=1.0, reach_along_m=0.5, reach_depth_m=0.05, height_m=2.6),
    "sparse20": RowShape(fruits_per_tree=(20, 20)),
    "dense300": RowShape(fruits_per_tree=(300, 300)),
}
"""Rows with other statistics, for which no setting may need a change."""

ROW_CELLS = tuple(
    cell
    for name, row in ROWS.items()
    for cell in (
        replace(_BASE, name=name, row=row),
        replace(_PART45, name=f"{name}-part45", row=row),
        replace(_NOOV, name=f"{name}-noov", row=row),
    )
)

_V_TRELLIS = RowShape(
    wood="leaning",
    wires_m=(0.5, 0.9, 1.3, 1.7, 2.1),
    lean_rad=0.35,
    spacing_m=1.0,
    reach_along_m=0.5,
    reach_depth_m=0.2,
    scatter_m=(0.05, 0.06),
    flatness=(1.0, 1.0, 0.6),
    fruits_per_tree=(40, 70),
    height_m=2.3,
)

PLANTINGS = {
    "trellis": RowShape(
        wood="arms",
        wires_m=(0.5, 1.0, 1.5, 2.0, 2.5),
        reach_along_m=0.6,
        scatter_m=(0.05, 0.05),
        fruits_per_tree=(50, 90),
        height_m=2.7,
    ),
    "vine": RowShape(
        wood="arms",
        wires_m=(0.9,),
        reach_along_m=0.6,
        scatter_m=(0.05, 0.05),
        fruits_per_tree=(20, 30),
        cluster_sizes=(0.8, 0.2),
        cluster_gap_m=(0.1, 0.14),
        least_gap_m=0.09,
        below_m=(0.05, 0.2),
        height_m=1.8,
    ),
    "pergola": RowShape(
        wood="roof",
        wires_m=(2.0,),
        spacing_m=1.5,
        reach_along_m=0.75,
        reach_depth_m=1.2,
        branches=(10, 14),
        scatter_m=(0.08, 0.1),
        flatness=(1.0, 1.0, 0.5),
        fruits_per_tree=(40, 80),
        below_m=(0.05, 0.15),
        height_m=2.2,
    ),
    "kiwifruit": RowShape(
        wood="roof",
        wires_m=(1.8,),
        spacing_m=1.5,
        reach_along_m=0.75,
        reach_depth_m=1.2,
        branches=(14, 18),
        scatter_m=(0.05, 0.07),
        flatness=(1.0, 1.0, 0.4),
        fruits_per_tree=(160, 220),
        cluster_sizes=(0.2, 0.25, 0.25, 0.15, 0.15),
        cluster_gap_m=(0.055, 0.075),
        least_gap_m=0.05,
        below_m=(0.03, 0.1),
        height_m=2.0,
    ),
    "spindle": RowShape(
        spacing_m=1.0, height_m=3.2, branches=(16, 24), reach_along_m=0.4, reach_depth_m=0.35, fruits_per_tree=(80, 140)
    ),
    "hedge": RowShape(
        spacing_m=0.8,
        height_m=2.5,
        branches=(10, 14),
        reach_along_m=0.5,
        reach_depth_m=0.2,
        scatter_m=(0.06, 0.09),
        fruits_per_tree=(50, 90),
    ),
    "vtrellis": _V_TRELLIS,
    "vthin": replace(_V_TRELLIS, scatter_m=(0.02, 0.03), flatness=(1.0, 1.0, 1.0)),
    "wires": RowShape(
        wood="arms",
        wires_m=(0.7, 1.0, 1.3, 1.6),
        reach_along_m=0.6,
        scatter_m=(0.01, 0.02),
        fruits_per_tree=(60, 90),
        cluster_sizes=(0.7, 0.3),
        height_m=2.0,
    ),
    "cone": RowShape(
        wood="tiers",
        wires_m=(0.5, 0.85, 1.2, 1.55, 1.9, 2.25, 2.6),
        spacing_m=1.0,
        branches=(21, 28),
        reach_along_m=0.6,
        reach_depth_m=0.6,
        scatter_m=(0.04, 0.06),
        fruits_per_tree=(30, 50),
        height_m=2.8,
    ),
    "singles": RowShape(
        wood="arms",
        wires_m=(0.6, 1.05, 1.5, 1.95, 2.4),
        reach_along_m=0.6,
        scatter_m=(0.015, 0.025),
        cluster_sizes=(1.0,),
        least_gap_m=0.09,
        fruits_per_tree=(24, 30),
        height_m=2.6,
    ),
}
"""How trees are trained: walls of wires, upright or as a V, both also as thin as the noise, a cordon with bunches
below, roofs, thin trees, some with branches in tiers, hedges, and a thin wall thinned by hand to single fruits."""

PLANTING_CELLS = tuple(
    cell
    for name, row in PLANTINGS.items()
    for cell in (
        replace(_PART45, name=f"{name}-part45", row=row),
        replace(_PART45, name=f"{name}-part45up", row=row, upright=True, seeded_as=f"{name}-part45"),
        replace(_NOOV, name=f"{name}-noov", row=row),
        replace(_NOOV, name=f"{name}-noovup", row=row, upright=True, seeded_as=f"{name}-noov"),
    )
)
"""The same questions on every planting: two of five trees in common with 45 % hidden, and none."""

_LONG = Cell("long", seen=40, row=PLANTINGS["singles"])

LONG_CELLS = (
    replace(_LONG, name="long-part35", shared=4, hidden=0.35, false_rate=0.10),
    replace(_LONG, name="long-noov", shared=0, right_answers=_NO_ANSWER),
)
"""Walls of single fruits 45 m long: four of forty trees in common, and none."""

_FRAME25 = replace(_BASE, name="frame25", frame=25)
_FRAME25_NOOV = replace(_NOOV, name="frame25-noov", frame=25)

FRAME_CELLS = (
    replace(_BASE, name="frame12", frame=12),
    replace(_BASE, name="frame16", frame=16),
    _FRAME25,
    replace(_FRAME25, name="frame25up", upright=True, seeded_as="frame25"),
    replace(_BASE, name="frame40", frame=40),
    replace(_BASE, name="frame40-trees1000", seen=1000, shared=1000, frame=40),
    _FRAME25_NOOV,
    replace(_FRAME25_NOOV, name="frame25-noovup", upright=True, seeded_as="frame25-noov"),
)
"""One frame of a few fruits against five trees and more."""

_OPPOSITE = replace(_BASE, name="opposite25", hidden=0.1, fade_m=0.1, depth_noise=2.0)
_OPPOSITE8 = replace(_OPPOSITE, name="opposite8", fade_m=0.03)
_OPPOSITE8FINE = replace(_OPPOSITE8, name="opposite8fine", noise_m=0.01, depth_noise=2.5)
_SAG = replace(_BASE, name="sag5", sag_m=0.05)
_TEN_TREES = Cell("ten", seen=10, shared=10)
_GROWN = replace(_O45S4, name="grown175", sizes=True, growth=(1.75, 1.75), seeded_as="o45s4")

CHANGE_CELLS = (
    _OPPOSITE,
    replace(_OPPOSITE, name="opposite15", fade_m=0.055),
    _OPPOSITE8,
    replace(_OPPOSITE8, name="opposite8up", upright=True, seeded_as="opposite8"),
    replace(_OPPOSITE8FINE, name="opposite25fine", fade_m=0.1),
    replace(_OPPOSITE8FINE, name="opposite15fine", fade_m=0.055),
    _OPPOSITE8FINE,
    replace(_OPPOSITE8FINE, name="opposite8fineup", upright=True, seeded_as="opposite8fine"),
    replace(_BASE, name="thinned30", thinned=0.3),
    replace(_BASE, name="thinned70", thinned=0.7),
    replace(_BASE, name="picked70", picked=0.7),
    replace(_BASE, name="picked80", picked=0.8),
    _SAG,
    replace(_SAG, name="sag10", sag_m=0.10),
    replace(_SAG, name="sag20", sag_m=0.20),
    replace(_BASE, name="drift1", drift=0.01),
    replace(_BASE, name="drift3", drift=0.03),
    replace(_BASE, name="doubled10", doubled=0.10),
    replace(_TEN_TREES, name="replanted50", replanted=0.5),
    replace(_TEN_TREES, name="replanted80", replanted=0.8),
    replace(_TEN_TREES, name="replanted80-sparse20", replanted=0.8, row=ROWS["sparse20"]),
    *(
        replace(_TEN_TREES, name=f"{name}-replanted70", replanted=0.7, row=PLANTINGS[name])
        for name in ("wires", "vine", "singles", "trellis")
    ),
    replace(_TEN_TREES, name="torn", tear_m=1.0),
    _GROWN,
    replace(_GROWN, name="grownmixed", growth=(1.5, 2.0)),
)
"""What changes between two visits: sides, thinning, picking, sag, drift, doubles, trees, growth; rows torn apart."""

_CLEAN = Cell("clean", hidden=0.0, false_rate=0.0, noise_m=0.01)

ADVERSARIAL_CELLS = (
    replace(_CLEAN, name="grid", scene="grid", hidden=0.2, right_answers=_NO_ANSWER),
    replace(_BASE, name="twins", scene="twins", seen=5, shared=1, right_answers=("Found", "Ambiguous")),
    replace(_BASE, name="twinrow", scene="twins"),
    replace(_BASE, name="mirror", mirrored=True, right_answers=_NO_ANSWER),
    replace(_BASE, name="plane", scene="plane"),
    replace(_CLEAN, name="six", scene="six", right_answers=("Found", *_NO_ANSWER)),
)
"""Symmetric, degenerate and tiny scenes: a confident wrong answer is the only failure."""

CELLS: dict[str, Cell] = {
    cell.name: cell
    for cell in (
        *PAPER_CELLS,
        *VARIANT_CELLS,
        *ROW_CELLS,
        *PLANTING_CELLS,
        *LONG_CELLS,
        *FRAME_CELLS,
        *CHANGE_CELLS,
        *ADVERSARIAL_CELLS,
    )
}
