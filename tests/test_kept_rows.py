"""What a long benchmark keeps when it is interrupted."""

from pathlib import Path

import pytest
from benchmarks.kept_rows import KeptRows


def test_what_was_made_is_not_made_again(tmp_path: Path) -> None:
    path = tmp_path / "kept.jsonl"
    made: list[int] = []

    def outcome(seed: int) -> dict[str, object]:
        made.append(seed)
        if seed == 2 and made.count(2) == 1:
            raise KeyboardInterrupt
        return {"seed": seed, "share": seed / 3}

    with pytest.raises(KeyboardInterrupt):
        [KeptRows(path).row({"seed": seed}, lambda seed=seed: outcome(seed)) for seed in range(4)]
    rows = [KeptRows(path).row({"seed": seed}, lambda seed=seed: outcome(seed)) for seed in range(4)]
    assert made == [0, 1, 2, 2, 3]
    assert [row["share"] for row in rows] == [0.0, 1 / 3, 2 / 3, 1.0]


def test_without_a_file_nothing_is_kept() -> None:
    made: list[int] = []
    for _ in range(2):
        KeptRows(None).row({"seed": 0}, lambda: {"n": made.append(0)})
    assert len(made) == 2
