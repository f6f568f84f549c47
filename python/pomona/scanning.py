"""From what the user has, a recording with boxes or a model, to the survey of it and its sessions."""

from __future__ import annotations

import datetime
import warnings
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Unpack

from pomona import __version__
from pomona.detect import Detector
from pomona.detect.opening import FoundBoxes, ModelSettings, open_detector
from pomona.detect.own import OwnDetector
from pomona.errors import PomonaError, PomonaWarning
from pomona.likes import SCANNED
from pomona.orchard.session import GUESSED
from pomona.outputs import Output, refuse_inputs, require_outputs
from pomona.recording import Recording, open_recording, selected
from pomona.recording.checks.swapped import check_sides
from pomona.store.values import iso_date
from pomona.streams import is_stream
from pomona.survey import Kept, Progress, Survey, write_survey
from pomona.survey import scan as survey_of
from pomona.survey.files import identity
from pomona.survey.part_files import parts_there

__all__ = ["SUFFIXES", "Scan", "guessed_date", "prepared", "require_session_name", "scan"]

SUFFIXES = (".gpkg", ".csv", ".ply")
"""Of what a scan writes."""


@dataclass(frozen=True, eq=False)
class Scan:
    """A scan that has been looked at and may begin.

    Attributes
    ----------
    recording : Recording
        The frames that are taken.
    boxes : FoundBoxes
        What finds the fruits.
    looks : mapping
        All that looking at one frame depends on, JSON values.
    choices : mapping
        Where poses and identities come from, and which rows count: `odometry`, `slam`, `retrack`, `all_rows`.
    config : mapping
        Values of the core's tables that differ from the defaults.
    every : int
        One of so many frames is taken.
    kept : Kept or None
        Where looks are kept.
    crops : bool
        Whether to keep a small picture of each fruit.
    """

    recording: Recording
    boxes: FoundBoxes
    looks: Mapping[str, Any]
    choices: Mapping[str, bool]
    config: Mapping[str, Any]
    every: int
    kept: Kept | None
    crops: bool = True

    def run(self, progress: Progress | None = None, stop: Callable[[], bool] | None = None) -> Survey:
        """Find the fruits; see `pomona.survey.scan`."""
        return survey_of(
            self.recording,
            self.boxes,
            depth=self.looks["depth"],
            **self.choices,
            crops=self.crops,
            config=self.config,
            keep=self.kept,
            progress=progress,
            stop=stop,
        )

    def write(self, output: Path, survey: Survey, *, name: str | None, date: str | None) -> dict[int, Path]:
        """Write what was found, with all that it was made from; see `write_survey`."""
        day = date or self.recording.date
        # A map takes no guessed date by accident: `map add` asks for --date where the session says so.
        named = bool(getattr(self.boxes, "with_ids", False)) and not self.choices["retrack"]
        about = {**self.looks, **self.choices, "every": self.every, "named": named}
        about |= {} if day else {"date": GUESSED}
        return write_survey(
            output,
            survey,
            self.recording,
            name=name or self.recording.name,
            date=day or guessed_date(self.recording),
            configuration={"scan": about, **self.config},
            inputs=self.boxes.inputs,
        )


def scan(
    recording: str | Path | Recording,
    *,
    detections: str | Path | Detector | None = None,
    model: str | Path | None = None,
    output: str | Path | None = None,
    name: str | None = None,
    date: str | datetime.date | None = None,
    depth: str = "auto",
    odometry: bool = False,
    slam: bool = False,
    retrack: bool = False,
    all_rows: bool = False,
    every: int = 1,
    first: int | None = None,
    last: int | None = None,
    keep: str | Path | None = None,
    crops: bool = True,
    config: Mapping[str, Any] | None = None,
    progress: Progress | None = None,
    stop: Callable[[], bool] | None = None,
    **of_model: Unpack[ModelSettings],
) -> Survey:
    """Find every fruit of a recording once, in 3D, with diameter and covariance, as `pomona scan` does.

    Parameters
    ----------
    recording : str, Path or Recording
        Whatever `pomona info` reads; with calibration or poses of its own: `pomona.recording.open_recording`.
    detections : str, Path or Detector, optional
        File of boxes: our CSV, MOTChallenge text or COCO json; or a folder of instance masks, 0000.png ...; or what
        gives `pomona.detect.Detections` when it is called with a frame: a function of yours. Without it
        and without a model: `detections.csv`, else `ids/`, in the recording's folder.
    model : str or Path, optional
        ONNX detector that finds the boxes.
    output : str or Path, optional
        Write the session here (.gpkg), or its fruits alone (.csv, .ply).
    name : str, optional
        Of the session; else the recording's.
    date : str or datetime.date, optional
        Of the session: local date, or date and time, as text in ISO 8601; else the recording's.
    depth : str
        ``auto``, ``stereo``, ``dense`` or the file of a stereo network.
    odometry, slam, retrack : bool
        Find poses although there are some, by the pictures, or by the fruits in all frames too; track boxes although
        they have ids.
    all_rows : bool
        Keep the fruits of rows behind the one that is scanned, where boxes are tracked.
    every, first, last : int, optional
        Take one of so many frames, from one frame number to another.
    keep : str or Path, optional
        Keep here what each frame showed, and go on from it.
    crops : bool
        Keep a small picture of each fruit in the session.
    config : mapping, optional
        Values of the core's tables that differ from `pomona.default_config()`.
    progress, stop : callable, optional
        As in `pomona.survey.scan`.
    **of_model
        Settings of the model, as in `pomona.detect.onnx.OnnxDetector.open`.

    Returns
    -------
    Survey
        `cloud` and `trajectory` are those of its longest part.

    Raises
    ------
    PomonaError
        Something is missing or wrong, or `output` would destroy an input, a map or a file of another kind.
    """
    target = None if output is None else Path(output)
    if target is not None:
        require_session_name(target)
        require_outputs([Output(path, SCANNED) for path in (target, *parts_there(target))], [])
    day = None if date is None else iso_date(date, "date")
    ready = prepared(
        open_recording(recording, own_poses=not (odometry or slam)) if isinstance(recording, str | Path) else recording,
        detections=_boxes_given(detections),
        model=None if model is None else Path(model),
        outputs=[] if target is None else [target],
        depth=depth,
        odometry=odometry,
        slam=slam,
        retrack=retrack,
        all_rows=all_rows,
        every=every,
        first=first,
        last=last,
        keep=None if keep is None else Path(keep),
        crops=crops,
        config=config or {},
        **of_model,
    )
    survey = ready.run(progress, stop)
    if target is not None:
        ready.write(target, survey, name=name, date=day)
    return survey


def prepared(
    recording: Recording,
    *,
    detections: Path | Detector | None,
    model: Path | None,
    outputs: Iterable[Path],
    depth: str,
    odometry: bool,
    slam: bool,
    retrack: bool,
    all_rows: bool,
    every: int,
    first: int | None,
    last: int | None,
    keep: Path | None,
    crops: bool,
    config: Mapping[str, Any],
    **of_model: Unpack[ModelSettings],
) -> Scan:
    """Look at everything that a scan needs before it begins; parameters as in `scan`.

    Raises
    ------
    PomonaError
        Something is missing or wrong, or one of `outputs` is an input.
    """
    boxes = open_detector(detections, model, recording, **of_model)
    refuse_inputs([*outputs, *([keep] if keep else [])], [*recording.inputs(), *boxes.inputs])
    taken = selected(recording, every=every, first=first, last=last)
    if keep is not None and isinstance(boxes, OwnDetector):
        raise PomonaError("keep: found a detector of your own, which is not known again; expected boxes or a model")
    looks = {"detector": boxes.configuration, "depth": depth}
    kept = None if keep is None else Kept(keep, {**_made_from(taken, boxes), **looks})
    check_sides(taken)
    choices = {"odometry": odometry, "slam": slam, "retrack": retrack, "all_rows": all_rows}
    return Scan(taken, boxes, looks, choices, config, every, kept, crops)


def _boxes_given(detections: object) -> Path | Detector | None:
    if isinstance(detections, str):
        return Path(detections)
    if detections is None or isinstance(detections, Path) or callable(detections):
        return detections
    found = type(detections).__name__
    raise PomonaError(f"detections: found {found}, expected a file, a folder of masks or a detector: f(frame)")


def require_session_name(output: Path) -> None:
    """Refuse a name that is none of what a scan writes; a stream needs no suffix."""
    nameless = not output.suffix and is_stream(output)
    if not nameless and output.suffix.lower() not in SUFFIXES:
        raise PomonaError(f"{output}: found suffix {output.suffix!r}, expected {', '.join(SUFFIXES)}")


def _made_from(recording: Recording, boxes: FoundBoxes) -> dict[str, Any]:
    files = identity(dict.fromkeys([*recording.inputs(), *boxes.inputs]))
    return {"version": __version__, "recording": str(recording.path.resolve()), "files": files}


def guessed_date(recording: Recording) -> str:
    """Give the day of the newest file, and say so."""
    newest_s = max(file.stat().st_mtime for file in recording.inputs())
    day = datetime.datetime.fromtimestamp(newest_s).date().isoformat()
    message = f"{recording.path}: no date noted, took {day} from the age of its files; --date says it better"
    warnings.warn(message, PomonaWarning, stacklevel=2)
    return day
