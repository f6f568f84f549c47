"""A process that was forked, as `multiprocessing` does it on Linux, has none of its parent's threads."""

import os
import select
import signal

import numpy as np
import pytest

import pomona
from pomona.localize import Localizer

pytestmark = [
    pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here"),
    # From Python 3.12 on.
    pytest.mark.filterwarnings("ignore:This process:DeprecationWarning"),
]

PATIENCE_S = 60.0
"""Waiting for the threads of another process takes for ever; all calls here together take a second."""


@pytest.fixture(scope="module")
def row():
    return np.random.default_rng(4).uniform((0, 0, 0), (6, 1, 2.5), (200, 3))


def pairs_of_child(call):
    """What `call` counts in a process that is forked; None where it does not end."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.write(write, str(call()).encode())
        os._exit(0)
    os.close(write)
    try:
        ready, _, _ = select.select([read], [], [], PATIENCE_S)
        return int(os.read(read, 100)) if ready else None
    finally:
        os.kill(child, signal.SIGKILL)
        os.waitpid(child, 0)
        os.close(read)


@pytest.mark.parametrize("threads", [None, 1, 2])
def test_what_was_made_before_a_fork_answers_after_it(row, threads):
    index, localizer = pomona.Index(row, threads=threads), Localizer(row, threads=threads)
    calls = {
        "match": lambda: len(pomona.match(row, row, threads=threads).pairs),
        "index": lambda: len(index.match(row).pairs),
        "pairs under": lambda: len(index.pairs_under(row, np.eye(4)).pairs),
        "locate": lambda: len(localizer.locate(row[:60]).pairs),
        "update": lambda: len(localizer.update(row[:60]).pairs),
        "new index": lambda: len(pomona.Index(row, threads=threads).match(row).pairs),
    }
    here = {name: call() for name, call in calls.items()}
    assert min(here.values()) > 50
    assert {name: pairs_of_child(call) for name, call in calls.items()} == here
    # The parent goes on.
    assert calls["index"]() == here["index"]


def test_a_child_of_a_child_answers(row):
    index = pomona.Index(row, threads=2)

    def grandchild():
        return pairs_of_child(lambda: len(index.match(row).pairs))

    assert pairs_of_child(grandchild) == len(index.match(row).pairs)
