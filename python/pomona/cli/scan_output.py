"""What `pomona scan` shows: progress on the standard error, the summary on the standard output."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pomona.amounts import amount
from pomona.cli.terminal import tell

if TYPE_CHECKING:
    from collections import Counter
    from collections.abc import Mapping, Sequence
    from pathlib import Path
    from typing import Any

    from pomona.recording import Recording
    from pomona.survey import Part, Progress, Survey
    from pomona.survey.tally import Tally

MOST_EMPTY = 3
"""Parts without fruits that are listed one by one."""


@contextmanager
def scanning(recording: Recording, boxes: str, *, told: bool) -> Iterator[Progress | None]:
    """Show where the boxes come from, frames, rate, fruits and time left on the standard error of a terminal."""
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    console = Console(stderr=True)
    if told or console.is_terminal:
        tell(boxes)
    if not console.is_terminal:
        yield None
        return
    columns = (
        "scanning",
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]:.1f} frames/s, {task.fields[fruits]} fruits"),
        TimeRemainingColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("scan", total=len(recording), fruits=0, rate=0.0)

        def show(done: int, _total: int, fruits: int) -> None:
            elapsed_s = bar.tasks[task].elapsed or 0.0
            bar.update(task, completed=done, fruits=fruits, rate=done / elapsed_s if elapsed_s else 0.0)

        yield show


def summary(recording: Recording, survey: Survey, written: Mapping[int, Path]) -> dict[str, Any]:
    """Put in numbers what was found and where it was written."""
    import numpy as np

    diameters_m = np.concatenate([part.cloud.diameters_m for part in survey.parts])
    n_come_to = sum(len(part.trajectory) for part in survey.parts) + len(survey.skipped)
    return {
        "output": [str(written[survey.longest])]
        + [str(path) for number, path in written.items() if number != survey.longest],
        "recording": str(recording.path),
        "n_frames": len(recording) if survey.stopped is None else n_come_to,
        "n_skipped_frames": len(survey.skipped),
        "stopped_after_frame": survey.stopped,
        "n_boxes": survey.detections,
        "n_refused": {reason.value: count for reason, count in sorted(survey.refused.items())},
        "boxes": {fate.name.lower(): count for fate, count in sorted(survey.tally.boxes.items())},
        "n_tracks": survey.tally.tracks.total(),
        "tracks": {fate.name.lower(): count for fate, count in sorted(survey.tally.tracks.items())},
        "frames": {fate.name.lower(): count for fate, count in sorted(survey.tally.frames.items())},
        "n_fruits": sum(len(part.cloud) for part in survey.parts),
        "parts": [_of_part(part, written.get(number)) for number, part in enumerate(survey.parts)],
        "median_diameter_mm": float(1000 * np.median(diameters_m)) if len(diameters_m) else None,
    }


def _of_part(part: Part, path: Path | None) -> dict[str, Any]:
    frames = part.trajectory.frames.tolist()
    return {
        "output": None if path is None else str(path),
        "first_frame": min(frames, default=None),
        "last_frame": max(frames, default=None),
        "n_frames": len(frames),
        "n_fruits": len(part.cloud),
        "began": part.began,
    }


def as_lines(found: dict[str, Any], survey: Survey) -> list[str]:
    """Say the same in words, with a table of what became of frames, boxes and tracks."""
    lines = [f"{found['output'][0]}: {_fruits(found)}, from {_boxes(found)}"]
    if found["stopped_after_frame"] is not None:
        lines.append(f"  stopped after frame {found['stopped_after_frame']}: what was found till then is written")
    if len(found["parts"]) > 1:
        lines += _parts_in_words(found["parts"])
    if left_out := found["tracks"].get("behind", 0):
        lines.append(
            f"  left out {amount(left_out, 'fruit')} in rows behind the one that was scanned: --all-rows keeps them"
        )
    if not found["n_fruits"]:
        lines.append("  no fruit was found: there is nothing to add to a map")
    return [
        *lines,
        *_frames(survey.tally),
        *_table("boxes", survey.tally.boxes),
        *_table("tracks", survey.tally.tracks),
    ]


def _frames(tally: Tally) -> list[str]:
    """Say what frames gave, where not all gave boxes."""
    return _table("frames", tally.frames) if len(tally.frames) > 1 else []


def _table(what: str, fates: Counter[Any]) -> list[str]:
    """Say what became of all of them, the most first; the rows add up to the first one."""
    if not fates:
        return []
    ranked = sorted(fates.items(), key=lambda row: (-row[1], row[0]))
    return [f"  {fates.total():>8} {what}", *(f"  {count:>8}   {fate}" for fate, count in ranked)]


def _boxes(found: dict[str, Any]) -> str:
    boxes = f"{amount(found['n_boxes'], 'box')} in {amount(found['n_frames'], 'frame')}"
    return f"{boxes}, {found['n_skipped_frames']} of them skipped" if found["n_skipped_frames"] else boxes


def _fruits(found: dict[str, Any]) -> str:
    n_parts = len(found["parts"])
    counts = [part["n_fruits"] for part in found["parts"] if part["output"] == found["output"][0]]
    fruits = amount(counts[0], "fruit")
    if n_parts > 1:
        fruits += f" in the longest of {n_parts} parts"
    if found["n_fruits"] > counts[0]:
        fruits += f" ({found['n_fruits']} in all, some maybe twice)"
    size = found["median_diameter_mm"]
    return fruits if size is None else f"{fruits}, median diameter {size:.1f} mm"


def _parts_in_words(parts: Sequence[dict[str, Any]]) -> list[str]:
    """Say what each part has; of many that are not written the first few, and how many more."""
    written = [part for part in parts if part["output"] is not None]
    others = [part for part in parts if part["output"] is None]
    shown = others[:MOST_EMPTY]
    told = sorted([*written, *shown], key=lambda part: part["first_frame"])
    lines = [f"  {_part_in_words(part)}" for part in told]
    if len(shown) < len(others):
        frames = sum(part["n_frames"] for part in others[len(shown) :])
        lines.append(
            f"  not written: {len(others) - len(shown)} more parts of {amount(frames, 'frame')} without fruits"
        )
    return lines


def _part_in_words(part: dict[str, Any]) -> str:
    where = part["output"] or "not written"
    began = f": {part['began']}" if part["began"] else ""
    return f"{where}: frames {part['first_frame']} to {part['last_frame']}, {amount(part['n_fruits'], 'fruit')}{began}"
