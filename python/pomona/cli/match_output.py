"""What `pomona match` says: for people and for programs."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from pomona.amounts import amount
from pomona.pairs import PAIR_COLUMNS

if TYPE_CHECKING:
    from collections.abc import Iterator
    from typing import Any

    from numpy.typing import NDArray

    from pomona.cloud import FruitCloud
    from pomona.matching import Match

_MEANINGS = {
    "Found": "the query lies in the map",
    "TooFew": "fewer fruits than a constellation needs",
    "Ambiguous": "several registrations explain the query equally well",
    "NoMatch": "no registration explains the query better than chance",
}


def as_json(match: Match, query: FruitCloud, map: FruitCloud) -> dict[str, Any]:
    """Return the answer as plain values; the keys are a contract. Fruits go by id, or by row number without ids."""
    unmatched = np.setdiff1d(np.arange(match.n_query), match.pairs[:, 0])
    return {
        "status": match.status.value,
        "map_from_query": None if match.map_from_query is None else match.map_from_query.tolist(),
        "scale": match.scale,
        "log_odds": match.log_odds if math.isfinite(match.log_odds) else None,
        "n_parts": match.n_parts,
        "parts": [map_from_query.tolist() for map_from_query in match.parts],
        "n_query": match.n_query,
        "n_map": match.n_map,
        "matches": [
            dict(zip(PAIR_COLUMNS, (_name(query, q), _name(map, m), probability, distance_m), strict=True))
            for q, m, probability, distance_m in _rows(match)
        ],
        "unmatched_query": [_name(query, row) for row in unmatched.tolist()],
        "elapsed_s": match.elapsed_s,
    }


def as_lines(match: Match) -> list[str]:
    """Return the answer for people: the verdict first, then the transform and the pairs."""
    lines = [f"{match.status.value}: {_MEANINGS[match.status.value]}"]
    if match.map_from_query is not None:
        lines += _describe_transform(match.map_from_query)
    if match.n_parts > 1:
        lines.append(
            _line("parts", f"{match.n_parts}, torn apart: they lie otherwise in the map; the pose is the first's")
        )
    share = f" ({len(match.pairs) / match.n_query:.0%})" if match.n_query else ""
    lines.append(_line("fruits", f"{match.n_query} in the query, {match.n_map} in the map"))
    lines.append(_line("pairs", f"{len(match.pairs)}{share}"))
    if len(match.pairs):
        lines += _describe_pairs(match)
    lines.append(_line("time", f"{match.elapsed_s:.3f} s"))
    for number, alternative in enumerate(match.alternatives, start=1):
        lines += [f"or, as good ({number} of {len(match.alternatives)})", *_describe_transform(alternative)]
    return lines


def as_stages(match: Match) -> list[str]:
    """Return what happened, a stage and its count a line."""
    width = max((len(name) for name, _ in match.stages), default=0)
    lines = (f"  {name:<{width}}  {_count(count)}" for name, count in match.stages)
    return ["stages", *lines]


def _count(count: float) -> str:
    return f"{count:,.0f}" if float(count).is_integer() else f"{count:,.4g}"


def _rows(match: Match) -> Iterator[tuple[int, int, float, float]]:
    pairs, probabilities, distances_m = match.pairs.tolist(), match.probabilities.tolist(), match.distances_m.tolist()
    for (q, m), probability, distance_m in zip(pairs, probabilities, distances_m, strict=True):
        yield q, m, probability, distance_m


def _name(cloud: FruitCloud, row: int) -> str | int:
    return row if cloud.ids is None else cloud.label(row)


def _line(title: str, text: str) -> str:
    return f"  {title:<12} {text}"


def _describe_transform(map_from_query: NDArray[np.float64]) -> list[str]:
    from scipy.spatial.transform import Rotation

    x, y, z = map_from_query[:3, 3]
    scale = float(np.cbrt(np.linalg.det(map_from_query[:3, :3])))
    turn_deg = Rotation.from_matrix(map_from_query[:3, :3] / scale).as_rotvec(degrees=True)
    angle_deg = float(np.linalg.norm(turn_deg))
    axis = turn_deg / angle_deg if angle_deg > 0.0 else np.array([0.0, 0.0, 1.0])
    return [
        _line("translation", f"x {x:+.3f}  y {y:+.3f}  z {z:+.3f} m"),
        _line("rotation", f"{angle_deg:.2f} deg about ({axis[0]:+.3f}, {axis[1]:+.3f}, {axis[2]:+.3f})"),
        _line("scale", f"{scale:.5g}"),
    ]


def _describe_pairs(match: Match) -> list[str]:
    distances_cm = 100.0 * match.distances_m
    sure = int(np.count_nonzero(match.probabilities >= 0.9))
    return [
        _line(
            "distances", f"median {np.median(distances_cm):.1f} cm, 90 % within {np.quantile(distances_cm, 0.9):.1f} cm"
        ),
        _line("probability", f"median {np.median(match.probabilities):.3f}, {amount(sure, 'pair')} at 0.9 or more"),
        _line("noise", f"{100.0 * match.noise_m:.1f} cm per axis"),
        _line("log-odds", f"{match.log_odds:.1f} nats"),
    ]
