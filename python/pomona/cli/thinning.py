"""`pomona thinning`: which fruits will drop, how many stay, which to thin."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from pomona.amounts import amount
from pomona.cli.terminal import say, say_json
from pomona.cli.verbs import Writes
from pomona.cli.visit_warnings import warn_of_visits
from pomona.likes import THINNING

if TYPE_CHECKING:
    from typing import Any

    from pomona.growth.season_growth import SeasonGrowth
    from pomona.growth.thinning_plan import ThinningPlan


def thinning(
    orchard: Path = typer.Argument(metavar="ORCHARD", help="The map (.gpkg), with visits on two days or more."),
    target: int | None = typer.Option(
        None, min=0, metavar="FRUITS", help="That each tree shall keep; fruits of no tree are not thinned."
    ),
    output: Annotated[Path | None, Writes(THINNING)] = typer.Option(
        None, "-o", "--output", help="CSV with a line for each hanging fruit: cluster, rate, probability, what to do."
    ),
    json: bool = typer.Option(False, "--json", help="Print JSON."),
) -> None:
    """Tell which fruits will drop by the growth-rate rule, and which to thin to come to a target load.

    Between the last two days of visits, fruits that grow at less than half the rate of the fastest will drop; where the
    days are too close to tell, none is said to. What a tree keeps beyond the target is thinned out of the fullest
    clusters, the smallest fruits first. Trees are those of the map, and where it has none those that `pomona map trees`
    would find; without any a target is refused.
    """
    from pomona.growth.season_growth import grow_season
    from pomona.growth.thinning_plan import plan_thinning
    from pomona.growth.visit_warnings import of_visits

    grown = grow_season(orchard)
    warn_of_visits(orchard, of_visits(grown))
    plan = plan_thinning(grown, target)
    if output is not None:
        _write(output, grown, plan)
    trees = _trees(grown, plan)
    if json:
        say_json({"target": target, **_rates(plan), "n_unmeasured": grown.fruits.n_unmeasured, "trees": trees})
        return
    say(*_about(orchard, grown, plan))
    say(f"  {'tree':>12} {'fruits':>7} {'will drop':>9} {'stay':>6} {'to thin':>8} {'in clusters':>11}")
    for tree in trees:
        drops, stay = ("-" if tree[name] is None else tree[name] for name in ("n_dropping", "n_staying"))
        counts = f"{tree['n_fruits']:>7} {drops:>9} {stay:>6} {tree['n_to_thin']:>8}"
        say(f"  {(tree['tree'] or _of_none(trees))[:12]:>12} {counts} {tree['n_clusters_to_thin']:>11}")
    if target is not None and not trees[-1]["tree"]:
        say(f"  {amount(trees[-1]['n_fruits'], 'fruit')} of no tree: none of them is thinned")
    if unmeasured := grown.fruits.n_unmeasured:
        say(f"  {amount(unmeasured, 'fruit')} that no visit measured: none of them is thinned")


def _rates(plan: ThinningPlan) -> dict[str, Any]:
    """Put in numbers what the rates say of all fruits, and how sure one is."""
    return {
        "fast_mm_per_day": plan.drop.fast_mm_per_day,
        "rate_sigma_mm_per_day": plan.drop.sigma_mm_per_day,
        "wanted_sigma_mm_per_day": plan.drop.wanted_mm_per_day,
        "is_told": plan.drop.is_told,
    }


def _about(orchard: Path, grown: SeasonGrowth, plan: ThinningPlan) -> list[str]:
    """Say between which days, and what they tell; where it is too little, until when to wait."""
    from datetime import timedelta

    from pomona.growth.fruit_drop import LARGEST_FRUITLET_MM
    from pomona.growth.thinning_plan import are_fruitlets

    before, last = sorted(set(grown.fruits.days))[-2:]
    between = f"{orchard}: from {before} to {last},"
    fastest = f"{between} the fastest fruits grew {plan.drop.fast_mm_per_day:.2f} mm a day"
    if not are_fruitlets(grown):
        return [
            fastest,
            f"  no fruitlets, which are up to {LARGEST_FRUITLET_MM:g} mm: the rule does not tell which will drop",
        ]
    if plan.drop.is_told:
        return [fastest]
    return [
        f"{between} cannot tell which fruits will drop: their rates are sure to {plan.drop.sigma_mm_per_day:.2f} mm a "
        f"day, and must be to {plan.drop.wanted_mm_per_day:.2f}",
        f"  wait until {before + timedelta(days=plan.days_to_wait)}, or measure from nearer",
    ]


def _of_none(trees: list[dict[str, Any]]) -> str:
    """Name the fruits of no tree, which are all where no tree is known."""
    return "no tree" if len(trees) > 1 else "all"


def _trees(grown: SeasonGrowth, plan: ThinningPlan) -> list[dict[str, Any]]:
    import numpy as np

    from pomona.growth.thinning_plan import are_fruitlets
    from pomona.growth.whole_fruits import whole_fruits

    numbers, actions = grown.fruits.trees.numbers[plan.rows], np.array(plan.actions)
    is_told = plan.drop.is_told or not are_fruitlets(grown)
    found = []
    for number, name in enumerate(grown.fruits.trees.names):
        of_tree, n_fruits = numbers == number, whole_fruits(plan.n_on_trees[number])
        if not name and number and not n_fruits:
            continue
        thin = of_tree & (actions == "thin")
        drops = of_tree & (actions == "drops")
        n_dropping = whole_fruits(plan.hang_chances[drops].sum())
        found.append(
            {
                "tree": name or None,
                "n_fruits": n_fruits,
                "n_dropping": n_dropping if is_told else None,
                "n_staying": n_fruits - n_dropping if is_told else None,
                "n_to_thin": int(thin.sum()),
                "n_clusters_to_thin": len(set(plan.clusters[thin].tolist())),
            }
        )
    return found


def _write(path: Path, grown: SeasonGrowth, plan: ThinningPlan) -> None:
    import numpy as np

    from pomona.growth.growth_tables import write_table

    trees = grown.fruits.trees.of_fruits()
    lines = [
        (
            grown.fruits.ids[row],
            trees[row],
            plan.clusters[i] + 1,
            plan.cluster_sizes[i],
            plan.sizes_mm[i],
            plan.rates_mm_per_day[i],
            plan.drop.probabilities[i],
            plan.actions[i],
        )
        for i, row in enumerate(plan.rows.tolist())
    ]
    columns = (
        "fruit_id",
        "tree",
        "cluster",
        "n_in_cluster",
        "diameter_mm",
        "rate_mm_per_day",
        "drop_probability",
        "action",
    )
    write_table(path, columns, [lines[i] for i in np.argsort(grown.fruits.ids[plan.rows])])
