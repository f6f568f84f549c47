"""Cultivars: how big their fruits grow, what shape they have and how they colour up."""

from __future__ import annotations

from dataclasses import dataclass, replace

__all__ = ["CULTIVARS", "Cultivar"]

Colour = tuple[float, float, float]


@dataclass(frozen=True)
class Cultivar:
    """Fruits of one kind of apple; colours are linear RGB, as a cloudy day shows them, without light.

    Attributes
    ----------
    harvest_after_bloom_days
        When a fruit is ripe.
    harvest_diameter_m, diameter_spread
        Mean diameter then, and the standard deviation of a fruit's against it, as a share.
    height_share
        Height of a fruit against its diameter.
    young_colour, ripe_colour
        Ground colour of a fruitlet and of a ripe fruit.
    dull_blush_colour, blush_colour
        The side in the sun as it begins to colour, and ripe.
    blush_shares
        Least and most of the skin that the blush of a ripe fruit covers.
    colouring_days
        Standard width of the logistic curve along which fruits colour up.
    """

    harvest_after_bloom_days: float
    harvest_diameter_m: float
    diameter_spread: float
    height_share: float
    young_colour: Colour
    ripe_colour: Colour
    dull_blush_colour: Colour
    blush_colour: Colour
    blush_shares: tuple[float, float]
    colouring_days: float = 12.0


_GALA = Cultivar(
    harvest_after_bloom_days=135.0,
    harvest_diameter_m=0.073,
    diameter_spread=0.07,
    height_share=0.90,
    young_colour=(0.16, 0.27, 0.045),
    ripe_colour=(0.62, 0.48, 0.10),
    dull_blush_colour=(0.20, 0.060, 0.035),
    blush_colour=(0.46, 0.030, 0.022),
    blush_shares=(0.55, 0.95),
)

CULTIVARS = {
    "gala": _GALA,
    "fuji": replace(
        _GALA,
        harvest_after_bloom_days=170.0,
        harvest_diameter_m=0.081,
        height_share=0.86,
        ripe_colour=(0.50, 0.45, 0.12),
        dull_blush_colour=(0.19, 0.065, 0.045),
        blush_colour=(0.36, 0.040, 0.040),
        blush_shares=(0.45, 0.90),
    ),
    "jonagold": replace(
        _GALA,
        harvest_after_bloom_days=155.0,
        harvest_diameter_m=0.083,
        ripe_colour=(0.62, 0.58, 0.10),
        dull_blush_colour=(0.22, 0.090, 0.040),
        blush_colour=(0.50, 0.060, 0.030),
        blush_shares=(0.15, 0.60),
    ),
    "granny-smith": replace(
        _GALA,
        harvest_after_bloom_days=175.0,
        harvest_diameter_m=0.079,
        young_colour=(0.12, 0.25, 0.035),
        ripe_colour=(0.27, 0.45, 0.055),
        dull_blush_colour=(0.22, 0.20, 0.050),
        blush_colour=(0.36, 0.26, 0.070),
        blush_shares=(0.0, 0.12),
    ),
    "golden": replace(
        _GALA,
        harvest_after_bloom_days=150.0,
        harvest_diameter_m=0.077,
        height_share=0.95,
        ripe_colour=(0.68, 0.62, 0.12),
        dull_blush_colour=(0.34, 0.24, 0.060),
        blush_colour=(0.60, 0.34, 0.080),
        blush_shares=(0.0, 0.2),
    ),
}
"""Two reds, a bicolour, a green and a yellow: diameters and days of harvest as growers have them."""
