"""The posed pictures of a sparse model as a recording of one camera alone: no depth, no second picture, no metres."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.reading import path_inside
from pomona.reconstruction import SparseModel
from pomona.reconstruction.picture_camera import PictureCamera
from pomona.reconstruction.sparse_model import ModelImage
from pomona.recording.calibration import Calibration
from pomona.recording.card import RecordingCard
from pomona.recording.description import describe
from pomona.recording.frame import Frame, chosen_rows
from pomona.recording.pictures import PICTURE_SUFFIXES, picture_inside, read_colour
from pomona.trajectory import Trajectory

__all__ = ["ModelRecording"]

MOST_DIGITS = 18
"""Of a frame number in a name."""


@dataclass(frozen=True, eq=False, repr=False)
class ModelRecording(RecordingCard):
    """The pictures of a model, in the order of their names; see `Recording` for what it gives.

    Attributes
    ----------
    model : SparseModel
    folder : Path or None
        Of the pictures; None where only boxes are asked for.
    images : mapping of int to ModelImage
        Images with a pose by their frame number.
    names : mapping of str to int
        Frame number of every picture, with a pose or without.
    """

    model: SparseModel
    folder: Path | None
    images: Mapping[int, ModelImage]
    names: Mapping[str, int]

    @classmethod
    def open(cls, model: SparseModel, folder: Path | None = None) -> ModelRecording:
        """Give numbers to the pictures: by the number that ends each name, else by the order of the names.

        Parameters
        ----------
        model : SparseModel
        folder : Path, optional
            Of the pictures; those in it that the model has no pose of are known too.

        Raises
        ------
        PomonaError
            The folder is not there, or the name of an image leads out of it.
        """
        registered = {image.name: image for image in model.images.values()}
        names = sorted({*registered, *(() if folder is None else _beside(folder, model, registered))})
        numbers = _numbers(names)
        images = {numbers[name]: image for name, image in registered.items()}
        return cls(model, folder, dict(sorted(images.items())), numbers)

    @property
    def path(self) -> Path:
        """The folder of the pictures, else of the model."""
        return self.folder or self.model.folder

    @property
    def name(self) -> str:
        """Name of that folder."""
        return self.path.resolve().name

    @property
    def date(self) -> str | None:
        """Nobody noted it."""
        return None

    @property
    def calibration(self) -> Calibration:
        """The largest picture's, without its distortion: boxes of files are held against its size."""
        return _pinhole(max((self.camera_of(number) for number in self.numbers), key=lambda one: one.size_px))

    @property
    def trajectory(self) -> Trajectory:
        """Poses in the frame and unit of the model; the frame number stands for the time that nobody noted."""
        poses = np.array([np.linalg.inv(self.model.camera_from_model(image)) for image in self.images.values()])
        numbers = np.array(self.numbers, np.int64)
        return Trajectory(numbers, numbers.astype(np.float64), poses)

    @property
    def numbers(self) -> tuple[int, ...]:
        """Frame numbers with a pose."""
        return tuple(self.images)

    @property
    def recorded_numbers(self) -> tuple[int, ...]:
        """Frame numbers of all pictures."""
        return tuple(sorted(self.names.values()))

    @property
    def times_s(self) -> NDArray[np.float64] | None:
        """Nobody noted them."""
        return None

    def __len__(self) -> int:
        return len(self.images)

    def camera_of(self, number: int) -> PictureCamera:
        """Give the camera of a frame."""
        return self.model.cameras[self.images[number].camera_id]

    def frames(self, numbers: Collection[int] | None = None) -> Iterator[Frame]:
        """Give the frames in the order of their names."""
        poses = self.trajectory.session_from_camera
        for row, number in chosen_rows(self.numbers, numbers):
            read = None
            if self.folder is not None:
                file = picture_inside(str(self.model.folder), self.folder, self.images[number].name)
                read = partial(read_colour, file, _pinhole(self.camera_of(number)))
            yield Frame(number, None, poses[row], read)

    def inputs(self) -> Iterator[Path]:
        """Give the files of the model, and the pictures where there are any."""
        yield from sorted(file for file in self.model.folder.iterdir() if file.suffix in (".bin", ".txt"))
        if self.folder is not None:
            files = (path_inside(str(self.model.folder), self.folder, one.name) for one in self.images.values())
            yield from (file for file in files if file.is_file())

    def description(self) -> dict[str, Any]:
        """Say what was found."""
        pictures = {} if self.folder is None else {"left": len(self)}
        return describe(self, "posed pictures", None, pictures)


def _pinhole(camera: PictureCamera) -> Calibration:
    (width, height), (fx, fy), (cx, cy) = camera.size_px, camera.focal_px.tolist(), camera.centre_px.tolist()
    return Calibration(width, height, fx, fy, cx, cy)


def _beside(folder: Path, model: SparseModel, registered: Collection[str]) -> Iterator[str]:
    """Give the names of all pictures in the folders where those of the model lie."""
    if not folder.is_dir():
        raise PomonaError(f"{folder}: not found, expected the folder of the model's pictures")
    parents = {path_inside(str(model.folder), folder, name).parent for name in registered}
    for parent in sorted(parent for parent in parents if parent.is_dir()):
        for file in parent.iterdir():
            if file.suffix.lower() in PICTURE_SUFFIXES and not file.name.startswith("."):
                yield file.relative_to(folder).as_posix()


def _numbers(names: list[str]) -> dict[str, int]:
    ends = [re.search(r"([0-9]+)$", name.rpartition(".")[0] or name) for name in names]
    numbers = [int(end[1]) for end in ends if end is not None and len(end[1]) <= MOST_DIGITS]
    if len(numbers) < len(names) or len(set(numbers)) < len(names):
        numbers = list(range(len(names)))
    return dict(zip(names, numbers, strict=True))
