"""Write star_i.json: constellations with their STaR-i codes, worked out by another way than the core's.

Run from anywhere with `python testdata/star_i_reference.py`; needs numpy alone. The tests of the core and of the
Python face both read the result.

The way: the turn about AB that gives the normal v of the plane ABC its largest z puts v along w, the part of the z axis
orthogonal to u = (1, 1, 1) / sqrt(3). So the paper's frame follows from matching two orthonormal bases, (AB, v, AB x v)
and (u, w, u x w), without angle, derivative or closed form; of v and -v the one with C_x <= C_y is right. All choices
(A, B, C, order of the rest) are made by trying every labelling and keeping the one that obeys the paper's rules.
"""

import itertools
import json
from pathlib import Path

import numpy as np

U = np.ones(3) / np.sqrt(3.0)
Z = np.array([0.0, 0.0, 1.0])
W = (Z - (Z @ U) * U) / np.linalg.norm(Z - (Z @ U) * U)
PAPER_BASIS = np.stack([U, W, np.cross(U, W)], axis=1)
# Columns of R in the core's documentation: along AB, towards C, along the normal.
TOWARDS_C = np.array([-1.0, 1.0, 0.0]) / np.sqrt(2.0)
CODE_BASIS = np.stack([U, TOWARDS_C, np.cross(U, TOWARDS_C)], axis=1)
MIN_RADIUS = 0.1


def paper_coordinates(points):
    """Return the coordinates of C, D, ... in the paper's frame for points in the order A, B, C, D, ..."""
    ab, ac = points[1] - points[0], points[2] - points[0]
    along, normal = ab / np.linalg.norm(ab), np.cross(ab, ac)
    for v in (normal, -normal):
        v = v / np.linalg.norm(v)
        turn = PAPER_BASIS @ np.stack([along, v, np.cross(along, v)], axis=1).T
        placed = (points[2:] - points[0]) @ turn.T * np.sqrt(3.0) / np.linalg.norm(ab)
        if placed[0, 0] <= placed[0, 1]:
            return placed
    raise AssertionError("one of the two normals obeys C_x <= C_y")


def distance_from_line(points):
    """Return the distance of each point from the line AB over |AB|."""
    along = (points[1] - points[0]) / np.linalg.norm(points[1] - points[0])
    return np.linalg.norm(np.cross(points - points[0], along), axis=1) / np.linalg.norm(points[1] - points[0])


def is_right_labelling(points):
    """Return whether the order A, B, C, D, ... obeys the paper's rules."""
    lengths = [np.linalg.norm(p - q) for p, q in itertools.combinations(points, 2)]
    centroid = points.mean(axis=0)
    if np.linalg.norm(points[1] - points[0]) < max(lengths):
        return False
    if np.linalg.norm(points[0] - centroid) > np.linalg.norm(points[1] - centroid):
        return False
    radii = distance_from_line(points)
    if radii[2] < radii.max():
        return False
    return bool(np.all(np.diff(paper_coordinates(points)[1:, 0]) >= 0))


def describe(points):
    """Return the order and the code, or why there is none."""
    k = len(points)
    if min(np.linalg.norm(p - q) for p, q in itertools.combinations(points, 2)) == 0.0:
        return {"degenerate": "duplicate"}
    longest = max(itertools.combinations(range(k), 2), key=lambda ij: np.linalg.norm(points[ij[0]] - points[ij[1]]))
    rest = [i for i in range(k) if i not in longest]
    if distance_from_line(points[[*longest, *rest]]).max() < MIN_RADIUS:
        return {"degenerate": "collinear"}
    (order,) = [o for o in itertools.permutations(range(k)) if is_right_labelling(points[list(o)])]
    in_paper = paper_coordinates(points[list(order)])
    in_code = in_paper @ CODE_BASIS
    return {
        "order": list(order),
        "paper": in_paper.tolist(),
        "code": [*in_code[0, :2].tolist(), *in_code[1:].ravel().tolist()],
    }


def main():
    """Write the cases beside this script."""
    random = np.random.default_rng(2602)
    named = [(f"{k} fruits, {i}", random.normal(size=(k, 3))) for k in (4, 5, 6, 7) for i in range(4)]
    cluster = np.array([4.1, -2.0, 1.3]) + 0.2 * random.normal(size=(5, 3))
    named += [
        ("an orchard's metres", cluster),
        ("far from the origin", cluster + np.array([512345.0, 4181234.0, 112.0])),
        ("a mirror image of an orchard's metres", cluster * np.array([-1.0, 1.0, 1.0])),
        ("on a line", np.outer(np.arange(5.0), [1.0, 2.0, -1.0]) + 1e-3 * random.normal(size=(5, 3))),
        ("one fruit twice", cluster[[0, 1, 2, 3, 3]]),
    ]
    cases = [{"name": name, "points": points.tolist(), **describe(points)} for name, points in named]
    text = json.dumps({"cases": cases}, indent=1)
    Path(__file__).with_name("star_i.json").write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
