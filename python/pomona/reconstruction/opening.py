"""From a folder to the sparse model in it, whichever way it is written; what does not hang together is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from pomona.errors import PomonaError
from pomona.reading import require_file
from pomona.reconstruction import colmap_binary, colmap_text
from pomona.reconstruction.sparse_model import Form, SparseModel

__all__ = ["open_reconstruction"]

SUFFIXES: dict[Form, str] = {"binary": ".bin", "text": ".txt"}
NEEDED = ("cameras", "images", "points3D")
OF_RIGS = ("rigs", "frames")


def open_reconstruction(folder: str | Path) -> SparseModel:
    """Read a COLMAP model.

    Parameters
    ----------
    folder : str or Path
        With cameras, images and points3D, all as .bin or all as .txt, and in the newer layout rigs and frames. Where
        both are there, the binary files are read, as COLMAP does.

    Raises
    ------
    PomonaError
        A file is missing, cut short or wrong, or names what is not there.
    """
    folder = Path(folder)
    form, has_rigs = _form(folder)
    reader = colmap_binary if form == "binary" else colmap_text
    files = {name: folder / f"{name}{SUFFIXES[form]}" for name in (*NEEDED, *OF_RIGS)}
    model = SparseModel(
        folder=folder,
        form=form,
        cameras_file=_content(files["cameras"]),
        cameras=reader.read_cameras(files["cameras"]),
        images=reader.read_images(files["images"]),
        points=reader.read_points(files["points3D"]),
        rigs=reader.read_rigs(files["rigs"]) if has_rigs else None,
        frames=reader.read_frames(files["frames"]) if has_rigs else None,
    )
    _require_points(files["points3D"], model)
    _require_images(files["images"], model)
    if has_rigs:
        _require_frames(files["frames"], model)
    return model


def _form(folder: Path) -> tuple[Form, bool]:
    """Tell how a model is written, and whether with rigs."""
    if not folder.is_dir():
        found = "a file" if folder.exists() else "nothing"
        raise PomonaError(f"{folder}: found {found}, expected the folder of a COLMAP model")
    there = [
        f"{name}{suffix}"
        for name in (*NEEDED, *OF_RIGS)
        for suffix in SUFFIXES.values()
        if (folder / f"{name}{suffix}").exists()
    ]
    for form, suffix in SUFFIXES.items():
        if {f"{name}{suffix}" for name in NEEDED} <= set(there):
            of_rigs = [name for name in OF_RIGS if f"{name}{suffix}" in there]
            if len(of_rigs) == 1:
                (only,) = of_rigs
                raise PomonaError(
                    f"{folder}: found {only}{suffix} alone, expected both rigs{suffix} and frames{suffix}"
                )
            return form, bool(of_rigs)
    expected = "expected cameras, images and points3D, all as .bin or all as .txt"
    raise PomonaError(f"{folder}: found {', '.join(there) or 'none of a COLMAP model'}, {expected}")


def _content(path: Path) -> bytes:
    require_file(path, "cameras of COLMAP")
    return path.read_bytes()


def _require_images(path: Path, model: SparseModel) -> None:
    if not model.images:
        raise PomonaError(f"{path}: found no image with a pose, expected at least one")
    names: dict[str, int] = {}
    known = np.append(np.sort(model.points.ids), -1)
    for image in model.images.values():
        if image.camera_id not in model.cameras:
            raise PomonaError(f"{path}: image {image.id}: found the camera {image.camera_id}, which is not there")
        if (other := names.setdefault(image.name, image.id)) != image.id:
            raise PomonaError(f"{path}: images {other} and {image.id}: found the same name twice, expected it once")
        seen = image.point_ids[image.point_ids != -1]
        strange = seen[known[np.searchsorted(known[:-1], seen)] != seen]
        if len(strange):
            raise PomonaError(f"{path}: image {image.id}: found the point {strange[0]}, which is not there")


def _require_points(path: Path, model: SparseModel) -> None:
    ids, counts = np.unique(model.points.ids, return_counts=True)
    if (counts > 1).any():
        raise PomonaError(f"{path}: found point {ids[counts > 1][0]} twice, expected it once")
    n_key_points = {image.id: len(image.point_ids) for image in model.images.values()}
    seen, rows = np.unique(model.points.tracks[:, 0], return_inverse=True)
    highest = np.full(len(seen), -1, np.int64)
    np.maximum.at(highest, rows, model.points.tracks[:, 1])
    for image_id, key_point in zip(seen.tolist(), highest.tolist(), strict=True):
        if not key_point < n_key_points.get(image_id, 0):
            found = f"found key point {key_point} of image {image_id} in a track"
            raise PomonaError(f"{path}: {found}, which is not there")


def _require_frames(path: Path, model: SparseModel) -> None:
    assert model.frames is not None
    assert model.rigs is not None
    for frame in model.frames.values():
        if frame.rig_id not in model.rigs:
            raise PomonaError(f"{path}: frame {frame.id}: found the rig {frame.rig_id}, which is not there")
        images = [number for (kind, _), number in frame.data if kind == "CAMERA"]
        strange = next((number for number in images if number not in model.images), None)
        if strange is not None:
            raise PomonaError(f"{path}: frame {frame.id}: found the image {strange}, which is not there")
    for image in model.images.values():
        _require_pose(path, model, image.id)


def _require_pose(path: Path, model: SparseModel, image_id: int) -> None:
    image = model.images[image_id]
    if image_id not in model.frame_of_image:
        raise PomonaError(f"{path}: image {image_id} ({image.name}) is in no frame, so it has no pose")
    try:
        model.camera_from_model(image)
    except KeyError:
        raise PomonaError(f"{path}: image {image_id}: its camera {image.camera_id} has no place in its rig") from None
