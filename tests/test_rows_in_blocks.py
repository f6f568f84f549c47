"""A row on wires that is looked for in a block of such rows that it is none of."""

import numpy as np
from numpy.typing import NDArray

import pomona


def wires(rng: np.random.Generator, length_m: float, n_rows: int) -> NDArray[np.float64]:
    """Rows 4 m apart on four wires, eight fruits to a metre of row."""
    n = int(8 * length_m)
    along, wire = rng.uniform(0.0, length_m, (n_rows, n)), 0.5 * rng.integers(0, 4, (n_rows, n))
    places = np.stack([along, np.tile(4.0 * np.arange(n_rows)[:, None], n), wire], axis=2).reshape(-1, 3)
    return places + rng.normal(0.0, 0.01, places.shape)


def answered(index: pomona.Index, seeds: range) -> int:
    """Of rows of 30 m that are no part of the block."""
    return sum(bool(index.match(wires(np.random.default_rng([seed, 6]), 30.0, 1))) for seed in seeds)


def test_a_block_that_is_wider_than_its_rows_are_long_answers_no_row_of_another() -> None:
    """Moved along the longest extent of the block, across its rows, every pose stood out of what it then met."""
    block = pomona.Index(wires(np.random.default_rng(2), 34.0, 14))
    assert answered(block, range(25)) == 0


def test_nor_does_what_is_cut_out_of_a_large_map() -> None:
    """Fruits around several candidates have a longest extent of their own, some degrees off the row."""
    block = pomona.Index(wires(np.random.default_rng(3), 120.0, 4), compact=True)
    assert answered(block, range(52, 68)) == 0
