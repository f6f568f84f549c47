"""The fuzz targets: a short run of all, and every case that was ever found."""

import random
import sys
import zlib

import pytest
from fuzz import CASES, load_target, target_names
from fuzz.mutation import mutated
from fuzz.run import replay, run_target

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="needs limits of memory as Linux has them")

SECONDS = 2.0
"""For each target; its start takes as long again."""


@pytest.mark.parametrize("name", target_names())
def test_nothing_but_our_error_leaves_a_reader_or_a_binding(name, tmp_path):
    outcome = run_target(name, SECONDS, 0, tmp_path)
    assert not outcome.failures, "\n".join(outcome.failures)
    assert outcome.tried


@pytest.mark.parametrize("name", sorted(folder.name for folder in CASES.iterdir()))
def test_what_was_found_once_is_refused_in_one_line(name):
    files = sorted((CASES / name).glob("*"))
    outcome = replay(name, files)
    assert not outcome.failures, "\n".join(outcome.failures)
    assert outcome.tried == len(files)


def test_the_same_seed_tries_the_same_cases():
    seeds = load_target("clouds").seeds()
    runs = [[zlib.crc32(mutated(random.Random(f"clouds 0 {n}"), seeds)) for n in range(50)] for _ in range(2)]
    assert runs[0] == runs[1]
    assert len(set(runs[0])) > 40
