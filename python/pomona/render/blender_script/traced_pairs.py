"""The story: the stage is set once; then the eye goes from pair to pair."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from graphics_card import use_graphics_card
from light import light
from passes import animate, light_pass, truth_pass
from stage import Stage

AT_ONCE = 10
"""Pairs between two changes of the pass, each of which costs a few seconds."""


def render_missing(folder: Path, first: int) -> None:
    """Set the stage once; look what is there, then render what is missing, in runs of pairs."""
    job = json.loads((folder / "job.json").read_text())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if job["gpu"]:
        use_graphics_card()
    scene = bpy.context.scene
    shown = bpy.data.collections.new("shown")
    scene.collection.children.link(shown)
    stage = Stage(shown, job, _surfaces(folder))
    light(scene, job["weather"])
    light_pass(scene, job)
    truth = truth_pass(job, shown)
    scene.camera = truth.camera = stage.eye
    count = len(job["poses"])
    for start in range(first, count, AT_ONCE):
        wanted = range(start, min(start + AT_ONCE, count))
        for pairs in _missing(folder, "truth", wanted):
            _look_what_is_there(stage, truth, folder, pairs)
        for pairs in _missing(folder, "pairs", wanted):
            _render_pairs(stage, scene, folder, pairs)


def _look_what_is_there(stage: Stage, truth: Any, folder: Path, pairs: range) -> None:
    def take(pair: int, picture: Any) -> None:
        ids, depth_m, hit = np.moveaxis(picture, -1, 0)
        there = {
            "depth_m": np.where(hit > 0.5, depth_m, np.inf).astype(np.float32),
            "ids": np.round(ids).astype(np.uint16),
        }
        _write(_file(folder, "truth", pair), there)

    animate(truth, pairs, folder / f"truth.{os.getpid()}", lambda pair: stage.arrange(pair, right=False), take)


def _render_pairs(stage: Stage, scene: Any, folder: Path, pairs: range) -> None:
    """Left pictures have even numbers, so that the noise of a frame is its own whatever was rendered before."""
    eyes: dict[str, Any] = {}

    def take(frame: int, picture: Any) -> None:
        eyes["right" if frame % 2 else "left"] = picture.astype(np.float16)
        if frame % 2:
            with np.load(_file(folder, "truth", frame // 2)) as there:
                _write(_file(folder, "pairs", frame // 2), {**eyes, **there})
            print(f"pomona pair {frame // 2}", flush=True)

    frames = range(2 * pairs.start, 2 * pairs.stop)
    path = folder / f"light.{os.getpid()}"
    animate(scene, frames, path, lambda frame: stage.arrange(frame // 2, right=frame % 2 == 1), take)


def _missing(folder: Path, kind: str, wanted: range) -> list[range]:
    """Give the numbers of the files that are not there, those that follow each other as one range."""
    runs: list[range] = []
    for number in (number for number in wanted if not _file(folder, kind, number).exists()):
        if runs and runs[-1].stop == number:
            runs[-1] = range(runs[-1].start, number + 1)
        else:
            runs.append(range(number, number + 1))
    return runs


def _surfaces(folder: Path) -> dict[str, dict[str, Any]]:
    surfaces: dict[str, dict[str, Any]] = {}
    with np.load(folder / "surfaces.npz") as arrays:
        for key in arrays.files:
            name, part = key.split("/")
            surfaces.setdefault(name, {})[part] = arrays[key]
    return surfaces


def _file(folder: Path, kind: str, pair: int) -> Path:
    return folder / kind / f"{pair:04d}.npz"


def _write(path: Path, arrays: dict[str, Any]) -> None:
    """Write beside the place and rename, so that a killed run leaves no half pair."""
    partial = path.with_suffix(f".{os.getpid()}.partial")
    with partial.open("wb") as file:
        np.savez(file, **arrays)
        file.flush()
        os.fsync(file.fileno())
    partial.replace(path)
