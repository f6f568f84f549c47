"""How far found poses are from true ones."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Errors:
    """What is wrong with the poses of some frames."""

    frames: int
    parts: int
    length_m: float
    end_m: float
    end_deg: float
    rms_m: float
    rms_deg: float
    segment_percent: float
    segment_deg_per_m: float


def compare(found: Array, true: Array, parts: int, segments_m: tuple[float, ...]) -> Errors:
    """Compare poses of one part with the truth.

    End: the last pose seen from the first one. Rms: after the rigid motion that fits positions and orientations best
    (`aligned`). Segments: KITTI's measure, mean over all sub-drives of the given lengths.
    """
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(true[:, :3, 3], axis=0), axis=1))])
    end = np.linalg.inv(np.linalg.inv(true[0]) @ true[-1]) @ (np.linalg.inv(found[0]) @ found[-1])
    after = np.linalg.inv(true) @ aligned(found, true)
    percents, rates = [], []
    for first in range(len(true)):
        for length_m in segments_m:
            last = int(np.searchsorted(travelled, travelled[first] + length_m))
            if last == len(true):
                continue
            error = np.linalg.inv(np.linalg.inv(true[first]) @ true[last]) @ np.linalg.inv(found[first]) @ found[last]
            percents.append(100 * np.linalg.norm(error[:3, 3]) / length_m)
            rates.append(angle_deg(error) / length_m)
    return Errors(
        frames=len(true),
        parts=parts,
        length_m=float(travelled[-1]),
        end_m=float(np.linalg.norm(end[:3, 3])),
        end_deg=angle_deg(end),
        rms_m=float(np.sqrt(np.mean(np.sum(after[:, :3, 3] ** 2, axis=1)))),
        rms_deg=float(np.sqrt(np.mean([angle_deg(one) ** 2 for one in after]))),
        segment_percent=float(np.mean(percents)) if percents else 0.0,
        segment_deg_per_m=float(np.mean(rates)) if rates else 0.0,
    )


def aligned(found: Array, true: Array) -> Array:
    """Move poses by the rigid motion that fits the truth best, orientations and positions.

    Positions alone do not fix the turn about a straight drive. The rotation is the mean of those that take each found
    orientation to the true one (the nearest rotation to their sum), the shift that of the centres.
    """
    u, _, vt = np.linalg.svd((true[:, :3, :3] @ found[:, :3, :3].transpose(0, 2, 1)).sum(axis=0))
    u[:, 2] *= np.sign(np.linalg.det(u @ vt))
    motion = np.eye(4)
    motion[:3, :3] = u @ vt
    motion[:3, 3] = true[:, :3, 3].mean(axis=0) - motion[:3, :3] @ found[:, :3, 3].mean(axis=0)
    return motion @ found


def angle_deg(transform: Array) -> float:
    return float(np.degrees(np.linalg.norm(cv2.Rodrigues(transform[:3, :3])[0])))
