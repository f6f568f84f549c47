"""A survey as files: sessions, and the stages that `--keep` leaves."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from pomona.atomic import whole_file
from pomona.cloud import FruitCloud
from pomona.csv_rows import write_rows
from pomona.export import export_cloud
from pomona.orchard import write_session
from pomona.recording import Recording
from pomona.recording.poses import write_tum
from pomona.survey.part import Part
from pomona.survey.part_files import part_files, tell_others
from pomona.survey.story import Survey

__all__ = ["STAGES", "hashes_of", "identity", "write_stages", "write_survey"]

CHUNK_BYTES = 1 << 20


def write_survey(
    output: Path,
    survey: Survey,
    recording: Recording,
    *,
    name: str,
    date: str,
    configuration: Mapping[str, Any],
    inputs: Iterable[Path],
) -> dict[int, Path]:
    """Write each part with fruits as a session of its own: a part has its own frame of reference.

    Parameters
    ----------
    output : Path
        .gpkg for sessions; .csv or .ply for their fruits alone; a stream without a suffix gets CSV. It holds the
        longest part; the others are named as `part_files` says.
    survey : Survey
        At least one part.
    recording : Recording
        What it was made of.
    name, date : str
        Of the session.
    configuration : mapping
        Effective settings, JSON values.
    inputs : iterable of Path
        Files that the survey depends on besides those of the recording.

    Returns
    -------
    dict of int to Path
        The file of each part that was written, by its number.
    """
    files = part_files(output, survey)
    tell_others(output, files.values())
    if output.suffix.lower() != ".gpkg":
        for number, path in files.items():
            _write_cloud(path, survey.parts[number].cloud)
        return files
    hashes = hashes_of(recording, inputs)
    for number, path in files.items():
        part = survey.parts[number]
        write_session(
            path,
            part.cloud,
            name=name if number == survey.longest else f"{name} part {number + 1}",
            date=date,
            recording=str(recording.path.resolve()),
            trajectory=part.trajectory,
            crops=part.crops,
            configuration=configuration,
            input_hashes=hashes,
            force=True,  # what may be replaced was asked before the work began
        )
    return files


def hashes_of(recording: Recording, inputs: Iterable[Path]) -> dict[str, str]:
    """Give the SHA-256 of the files of a recording, by their names in it, and of others."""
    return {_shown(file, recording): _sha256(file) for file in dict.fromkeys([*recording.inputs(), *inputs])}


def _write_cloud(path: Path, cloud: FruitCloud) -> None:
    export_cloud(cloud, path, "ply" if path.suffix.lower() == ".ply" else "csv")


def write_stages(folder: Path, survey: Survey) -> None:
    """Write poses and tracks of the parts in formats that `pomona scan` reads: poses_tum.txt, tracks.csv."""
    for name, write in STAGES.items():
        files = part_files(folder / name, survey)
        tell_others(folder / name, files.values())
        for number, path in files.items():
            with whole_file(path) as partial:
                write(partial, survey.parts[number])


def _write_poses(path: Path, part: Part) -> None:
    write_tum(path, part.trajectory)


def _write_tracks(path: Path, part: Part) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        write_rows(file, itertools.chain([("frame", "xmin", "ymin", "xmax", "ymax", "score", "id")], _tracks(part)))


STAGES: Mapping[str, Callable[[Path, Part], None]] = {"poses_tum.txt": _write_poses, "tracks.csv": _write_tracks}
"""What `write_stages` leaves, by name."""


def _tracks(part: Part) -> Iterable[tuple[object, ...]]:
    """Rows of the boxes that are fruits."""
    boxes, ids = part.boxes, part.cloud.ids or ()
    for frame, box_px, score, fruit in zip(boxes.frames, boxes.boxes_px, boxes.scores, boxes.fruits, strict=True):
        if fruit >= 0:
            yield (frame, *(f"{edge:.3f}" for edge in box_px), f"{score:.4f}", ids[fruit])


def identity(files: Iterable[Path]) -> dict[str, list[int]]:
    """Say which files these are, near enough to notice that one changed: size in bytes and time of the last change."""
    stats = {str(file.resolve()): file.stat() for file in files}
    return {name: [stat.st_size, stat.st_mtime_ns] for name, stat in stats.items()}


def _sha256(file: Path) -> str:
    digest = hashlib.sha256()
    with file.open("rb") as stream:
        while chunk := stream.read(CHUNK_BYTES):
            digest.update(chunk)
    return digest.hexdigest()


def _shown(file: Path, recording: Recording) -> str:
    return str(file.relative_to(recording.path)) if file.is_relative_to(recording.path) else str(file)
