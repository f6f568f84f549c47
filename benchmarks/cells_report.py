"""The tables and the reliability diagram of the cells, from their CSV files."""

from collections.abc import Iterable, Sequence
from statistics import median

from benchmarks.results import FOLDER, markdown, read_rows, share, write_text
from pomona.evaluate import PairScore

HEADER = (
    "cell", "method", "noise", "right", "wrong", "P", "R", "oracle P", "oracle R", "gated P", "gated R",
    "P at .9", "R at .9", "CPU ms", "verdicts",
)  # fmt: skip

INTRODUCTION = """# Test cells

Two seeded visits to one row per pair (`pomona synth clouds CELL --seed S`). *right*: pairs of visits answered rightly,
with a pose within 5 degrees, 0.3 m at the cloud's centre and 5 % of scale, or with no pose where there is none (noov,
mirror, grid). *wrong*: a false pose; the rest got no answer. P and R are means over the pairs of visits with the right
pose. *oracle*: true pose and noise, then the verified method's last stage; *gated*: true pose and noise, then
maximum-likelihood assignment within 3.37 sigma; both over the same pairs of visits. *P at .9*: of the pairs of fruits
given a probability of at least 0.9 (the paper's method gives votes, no probabilities that deserve the name). CPU:
median, one thread, query and map from bare positions.

"""


def write(methods: Sequence[str]) -> None:
    """Write cells.md and reliability.png of whatever was measured."""
    groups: dict[tuple[str, str], list[tuple[str, list[dict[str, str]]]]] = {}
    for method in methods:
        for row in read_rows(f"cells_{method}.csv"):
            entries = groups.setdefault((row["cell"], row["noise"]), [])
            if not entries or entries[-1][0] != method:
                entries.append((method, []))
            entries[-1][1].append(row)
    lines = [line(method, rows) for entries in groups.values() for method, rows in entries]
    write_text("cells.md", INTRODUCTION + markdown(HEADER, lines))
    bins = read_rows("reliability_verified.csv")
    if bins:
        _draw_reliability(bins)


def line(method: str, rows: Sequence[dict[str, str]]) -> tuple[str, ...]:
    """Summarise the rows of one cell, one method and one noise setting."""
    right = [row for row in rows if row["outcome"] == "right"]
    posed = [row for row in right if row["verdict"] == "Found"]
    verdicts = {row["verdict"]: 0 for row in rows}
    for row in rows:
        verdicts[row["verdict"]] += 1
    return (
        rows[0]["cell"],
        method,
        rows[0]["noise"],
        f"{len(right)}/{len(rows)}",
        str(sum(row["outcome"] == "wrong" for row in rows)),
        *_shares(_scores(posed, "true", "false")),
        *_shares(_scores(posed, "oracle_true", "oracle_false")),
        *_shares(_scores(posed, "gated_true", "gated_false")),
        *_shares(_scores(posed, "sure_true", "sure_false")),
        f"{1e3 * median(float(row['cpu_s']) for row in rows):.0f}",
        " ".join(f"{name} {count}" for name, count in sorted(verdicts.items())),
    )


def _scores(rows: Iterable[dict[str, str]], true: str, false: str) -> list[PairScore]:
    """Scores of the named columns; fruits in both clouds are those right or missed."""
    return [
        PairScore(int(row[true]), int(row[false]), int(row["true"]) + int(row["missed"]) - int(row[true]))
        for row in rows
    ]


def _shares(scores: Sequence[PairScore]) -> tuple[str, str]:
    precisions = [score.precision for score in scores if score.precision is not None]
    recalls = [score.recall for score in scores if score.recall is not None]
    return share(_mean(precisions)), share(_mean(recalls))


def _mean(values: Sequence[float]) -> float | None:
    return sum(values) / len(values) if values else None


def _draw_reliability(bins: Sequence[dict[str, str]]) -> None:
    """Share of right pairs over the probability they were given, all cells and the cells one by one."""
    import matplotlib as mpl

    mpl.use("agg")
    import matplotlib.pyplot as plt

    figure, axes = plt.subplots(figsize=(6, 5.5), layout="constrained")
    axes.plot([0, 1], [0, 1], color="0.7", linewidth=1)
    cells = list(dict.fromkeys(row["cell"] for row in bins))
    for cell in cells:
        axes.plot(*_curve([row for row in bins if row["cell"] == cell]), color="0.8", linewidth=0.7, zorder=1)
    axes.plot(*_curve(bins), "o-", color="tab:red", label="all cells", zorder=3)
    axes.plot([], [], color="0.8", linewidth=0.7, label="one cell each")
    axes.set(
        xlabel="probability given to a pair", ylabel="share of pairs that are right", xlim=(0, 1.01), ylim=(0, 1.01)
    )
    axes.set_title("Reliability of the pairs' probabilities")
    axes.legend(frameon=False)
    figure.savefig(FOLDER / "reliability.png", dpi=130)
    plt.close(figure)


def _curve(bins: Sequence[dict[str, str]]) -> tuple[list[float], list[float]]:
    """Mean probability and share of right pairs per bin; bins under 50 pairs say nothing and are left out."""
    totals: dict[float, list[float]] = {}
    for row in bins:
        total = totals.setdefault(float(row["from"]), [0.0, 0.0, 0.0])
        for at, column in enumerate(("pairs", "right", "probability_sum")):
            total[at] += float(row[column])
    kept = [total for _, total in sorted(totals.items()) if total[0] >= 50]
    return [total[2] / total[0] for total in kept], [total[1] / total[0] for total in kept]
