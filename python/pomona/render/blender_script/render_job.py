"""Render the pairs of a job that are not there yet: `python render_job.py FOLDER`.

The folder has `job.json` and `surfaces.npz`, written by pomona.render.photo; pairs come to `pairs/NNNN.npz`, each whole
or not at all. A line on the standard output tells of each.
"""

from __future__ import annotations

import json
import os
import sys
from pathlib import Path
from typing import Any

NO_BLENDER = 3
"""Exit code when Blender's module cannot be loaded."""

try:
    import bpy
except ImportError as error:
    print(error, file=sys.stderr)
    sys.exit(NO_BLENDER)

import numpy as np
from light import light
from passes import light_pass, render, truth_pass
from stage import camera, look, set_up, sway


def main(folder: Path) -> None:
    """Set the stage once, then take the missing pairs in turn."""
    job = json.loads((folder / "job.json").read_text())
    missing = [pair for pair in range(len(job["poses"])) if not _pair_file(folder, pair).exists()]
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    shown = bpy.data.collections.new("shown")
    scene.collection.children.link(shown)
    leaves = set_up(shown, job, _surfaces(folder))["leaves"]
    eye = camera(scene, job)
    shown.objects.link(eye)
    light(scene, job["weather"])
    light_pass(scene, job)
    truth = truth_pass(job, shown)
    scene.camera = truth.camera = eye
    still = np.empty(len(leaves.vertices) * 3, dtype=np.float32)
    leaves.vertices.foreach_get("co", still)
    for pair in missing:
        if job["weather"]["wind_m"] > 0:
            sway(leaves, still.reshape(-1, 3), job, pair)
        _write(_pair_file(folder, pair), _pair(scene, truth, eye, job, pair, folder / f"pass.{os.getpid()}.exr"))
        print(f"pomona pair {pair}", flush=True)


def _pair(scene: Any, truth: Any, eye: Any, job: dict[str, Any], pair: int, path: Path) -> dict[str, Any]:
    pose = job["poses"][pair]
    pictures = []
    for side, aside_m in enumerate((0.0, job["baseline_m"])):
        look(eye, pose, aside_m)
        scene.cycles.seed = (job["seed"] * 1_000_003 + 2 * pair + side) % 2**31
        pictures.append(render(scene, path))
    look(eye, pose, 0.0)
    ids, depth_m, hit = np.moveaxis(render(truth, path), -1, 0)
    return {
        "left": pictures[0].astype(np.float16),
        "right": pictures[1].astype(np.float16),
        "depth_m": np.where(hit > 0.5, depth_m, np.inf).astype(np.float32),
        "ids": np.round(ids).astype(np.uint16),
    }


def _surfaces(folder: Path) -> dict[str, dict[str, Any]]:
    surfaces: dict[str, dict[str, Any]] = {}
    with np.load(folder / "surfaces.npz") as arrays:
        for key in arrays.files:
            name, part = key.split("/")
            surfaces.setdefault(name, {})[part] = arrays[key]
    return surfaces


def _pair_file(folder: Path, pair: int) -> Path:
    return folder / "pairs" / f"{pair:04d}.npz"


def _write(path: Path, arrays: dict[str, Any]) -> None:
    """Write beside the place and rename, so that a killed run leaves no half pair."""
    partial = path.with_suffix(f".{os.getpid()}.partial")
    with partial.open("wb") as file:
        np.savez(file, **arrays)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
