"""A sparse model as files, in the layout and the form that it was read in."""

from __future__ import annotations

from pathlib import Path

from pomona.reconstruction import colmap_binary, colmap_text
from pomona.reconstruction.sparse_model import SparseModel

__all__ = ["write_reconstruction"]


def write_reconstruction(folder: Path, model: SparseModel) -> None:
    """Write the files of a model into an empty folder."""
    writer, suffix = (colmap_binary, "bin") if model.form == "binary" else (colmap_text, "txt")
    (folder / f"cameras.{suffix}").write_bytes(model.cameras_file)
    for name, content in writer.written(model.images, model.points, model.rigs, model.frames):
        with (folder / f"{name}.{suffix}").open("wb") as file:
            file.writelines(content)
