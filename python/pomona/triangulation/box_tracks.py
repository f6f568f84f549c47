"""Which boxes of which pictures show one fruit, without depth: the likeliest places first, each box once.

The place with most evidence takes the boxes that fit it in all pictures, moves to where they say, and takes again.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pomona.triangulation.box_evidence import BoxEvidence
from pomona.triangulation.hypotheses import Hypotheses
from pomona.triangulation.many_views import triangulated
from pomona.triangulation.neighbouring_pictures import neighbours_of
from pomona.triangulation.posed_boxes import PosedBoxes, PosedPictures
from pomona.triangulation.proposals import hypotheses_of

__all__ = ["LEAST_VIEWS", "tracks_of_boxes"]

Rows = NDArray[np.int64]

LEAST_VIEWS = 3
"""Two directions meet by chance all the time, three seldom."""

MARGIN = 3.0
"""Nats beyond what the best of all proposals has by chance; boxes at random make four times as many fruits without."""

ROUNDS = 2
"""Of taking boxes and moving."""


def tracks_of_boxes(pictures: PosedPictures, boxes: PosedBoxes) -> Rows:
    """Give the fruit of each box, (B,), numbered from 0, or -1 where it is of none."""
    first_box = np.searchsorted(boxes.pictures, np.arange(len(pictures) + 1)).astype(np.int64)
    judge = BoxEvidence(pictures, boxes)
    proposed = [hypotheses_of(judge, first_box, row) for row in range(len(pictures))]
    fruits, n_fruits = np.full(len(boxes), -1, np.int64), 0
    order = sorted(
        (-float(evidence), int(found.boxes[place, 0]), row, place)
        for row, found in enumerate(proposed)
        for place, evidence in enumerate(found.evidence)
    )
    # Of as many as are proposed chance makes one so likely; and that a place was moved to its boxes explains more.
    least_evidence = MARGIN + np.log(1 + sum(found.n_proposed for found in proposed))
    for _, box, row, place in order:
        if fruits[box] >= 0:
            continue
        taken, evidence = _taken(judge, fruits, proposed[row].select(np.array([place])), row)
        if len(taken) >= LEAST_VIEWS and evidence >= least_evidence:
            fruits[taken], n_fruits = n_fruits, n_fruits + 1
    return fruits


def _taken(judge: BoxEvidence, fruits: Rows, place: Hypotheses, row: int) -> tuple[Rows, float]:
    """Give the boxes that a place takes of those that are left, and what speaks for it by now, nats.

    The picture that proposed the place does not: the place is where its box is.
    """
    pictures, boxes, nothing = judge.pictures, judge.boxes, (np.empty(0, np.int64), -np.inf)
    for _ in range(ROUNDS):
        _, taken = _asked(judge, fruits, place)
        if len(taken) < LEAST_VIEWS:
            return nothing
        views = triangulated(pictures, boxes, taken, np.zeros(len(taken), np.int64), place.positions)
        if not np.isfinite(views.positions).all():
            return nothing
        diameter = np.median(boxes.diameters(pictures.in_cameras(views.positions, boxes.pictures[taken]), taken))
        place = Hypotheses(place.boxes, views.positions, views.covariances, np.array([diameter]), place.evidence)
    gains, taken = _asked(judge, fruits, place)
    asked = np.setdiff1d(np.union1d(neighbours_of(pictures, row), boxes.pictures[taken]), [row])
    return taken, float(gains[asked].sum())


def _asked(judge: BoxEvidence, fruits: Rows, place: Hypotheses) -> tuple[NDArray[np.float64], Rows]:
    """Ask all pictures for one place: what each says, (P,), and the boxes that speak."""
    all_ = np.arange(len(judge.pictures))
    heard = judge(place, np.zeros(len(all_), np.int64), all_, fruits < 0)
    return heard.gains, heard.boxes[heard.boxes >= 0]
