"""The key of a step: all that its result follows from, as one hash. What has the key of a done step is done."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path

from pomona import __version__
from pomona.errors import PomonaError
from pomona.farm.file_hashes import FileHashes, stamps
from pomona.farm.ledger import Stamp
from pomona.farm.steps import FarmStep, MadeBy

__all__ = ["Keys", "keys_of"]


@dataclass
class Keys:
    """What is known of the steps before any is run.

    Attributes
    ----------
    of : dict
        Key of each step by its name; a step whose input cannot be read has none, nor have those behind it.
    settings : dict
        Hash of the flags of each step, with the files that they name.
    wrong : dict
        By name, why a step's input cannot be read.
    stamps : dict
        By name, size and age of the inputs when they were read.
    """

    of: dict[str, str] = field(default_factory=dict)
    settings: dict[str, str] = field(default_factory=dict)
    wrong: dict[str, str] = field(default_factory=dict)
    stamps: dict[str, dict[Path, Stamp | None]] = field(default_factory=dict)


def keys_of(
    steps: Iterable[FarmStep], folder: Path, hashes: FileHashes, reading: Callable[[int], None] = lambda _number: None
) -> Keys:
    """Read the inputs of all steps, which come behind those that they need, and give their keys.

    Parameters
    ----------
    steps : iterable of FarmStep
        As `steps_of` gives them.
    folder : Path
        Of the plan: inputs are named from there, so that a farm may be moved as a whole.
    hashes : FileHashes
        Remembers what was read before.
    reading : callable
        Told the number of each step whose inputs are read.
    """
    keys = Keys()
    for number, step in enumerate(steps):
        reading(number)
        try:
            found = {}
            before = stamps(step.inputs)
            for path in step.inputs:
                found[os.path.relpath(path, folder)] = hashes.of(path)
        except (PomonaError, OSError) as error:
            keys.wrong[step.name] = str(error)
            continue
        if any(name not in keys.of for name in step.needs):
            continue
        keys.stamps[step.name] = before
        commands = [[f"<{word.step}>" if isinstance(word, MadeBy) else word for word in line] for line in step.commands]
        named = sorted(found[os.path.relpath(path, folder)] for path in step.settings_files)
        keys.settings[step.name] = _hash([step.settings, named])
        needed = [keys.of[name] for name in step.needs]
        keys.of[step.name] = _hash([__version__, step.kind, commands, sorted(found.items()), needed])
    return keys


def _hash(value: object) -> str:
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()
