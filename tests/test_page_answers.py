"""The page at the first look, in a real browser: how many hang, how big, how fast, what to do, tree by tree."""

import contextlib
import re
import shutil
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.page_draw import drawn_document

from growth_maker import FRUITS_OF_TREE, GrownRow, grow_row
from page_maker import opened, write_page
from pomona import geopackage
from pomona.growth.bearing_trees import bearing_trees
from pomona.orchard import OrchardMap
from pomona.orchard.hanging import hang_chances
from pomona.viewer.packed_columns import packed
from pomona.viewer.season_page import Wishes, season_document
from pomona.viewer.season_report import write_report

N = 3 * FRUITS_OF_TREE


def test_the_first_look_answers_four_questions(browser: Any, grown_row: GrownRow, tmp_path: Path) -> None:
    write_report(grown_row.path, tmp_path / "report.html", Wishes(harvest=date(2024, 9, 1), target=20))
    with opened(browser, (tmp_path / "report.html").as_uri()) as page:
        many, big, fast, to_do = page.locator(".answer").all_inner_texts()
        trees = page.locator(".trees tbody tr").all()
    hanging = round(float(hang_chances(OrchardMap(grown_row.path).fruits()).sum()))
    assert f"{hanging} fruits hang" in " ".join(many.split())
    assert re.search(r"\d\d\.\d mm on average", " ".join(big.split()))
    assert re.search(r"0\.\d\d mm a day", " ".join(fast.split()))
    assert re.search(r"Plan \d+ packs for 1\N{NO-BREAK SPACE}Sept", to_do)
    assert len(trees) == 3


def test_what_is_likelier_no_fruit_counts_by_its_probability(browser: Any, grown_row: GrownRow, tmp_path: Path) -> None:
    path = tmp_path / "doubted.gpkg"
    shutil.copy(grown_row.path, path)
    with contextlib.closing(geopackage.connect(path)) as connection, connection:
        connection.execute("UPDATE fruits SET state = 'missed', fruit_probability = 0.3 WHERE id <= 5")
        connection.execute("UPDATE fruits SET state = 'missed', fruit_probability = 0.9 WHERE id BETWEEN 6 AND 8")
    write_report(path, tmp_path / "report.html", Wishes())
    with opened(browser, (tmp_path / "report.html").as_uri()) as page:
        many, _, _, to_do = (" ".join(text.split()) for text in page.locator(".answer").all_inner_texts())
        assert f"{N - 4} fruits hang" in many, "82 that were seen, 2.7 and 1.5 that are expected"
        assert "5 seen once are likelier no fruit" in many
        assert "3 fruits hid from the last visit" in to_do
        page.get_by_role("tab", name="Fruits").click()
        page.get_by_label("State").select_option("hanging")
        assert f"{N - 5} of {N} fruits" in page.locator(".filter-bar").inner_text()


@pytest.mark.parametrize(
    ("sure", "n_hang", "said", "lost"),
    [
        (0.2, N - 24, "6 fruits hid from the last visit", "24 more were seen and have"),
        (0.97, N - 1, "29 fruits hid from the last visit", "1 more was seen and has"),
        (0.01, N - 30, "", "30 more were seen and have"),
    ],
)
def test_what_the_last_visit_missed_counts_as_far_as_it_hangs(
    browser: Any, grown_row: GrownRow, tmp_path: Path, sure: float, n_hang: int, said: str, lost: str
) -> None:
    """A tree was picked: the map calls its 30 fruits missed, and doubts that they hang."""
    path = tmp_path / "picked.gpkg"
    shutil.copy(grown_row.path, path)
    with contextlib.closing(geopackage.connect(path)) as connection, connection:
        connection.execute("UPDATE fruits SET state = 'missed', state_probability = ? WHERE id <= 30", (sure,))
    write_report(path, tmp_path / "report.html", Wishes())
    with opened(browser, (tmp_path / "report.html").as_uri()) as page:
        many, _, _, to_do = (" ".join(text.split()) for text in page.locator(".answer").all_inner_texts())
        counts = [line.locator("td").first.inner_text() for line in page.locator(".trees tbody tr").all()]
    assert f"{n_hang} fruits hang" in many
    assert f"{lost} probably gone" in many
    assert said in to_do
    assert ("hid from" in to_do) == bool(said)
    assert "gone" not in to_do, "it is said once, with the count"
    assert sum(map(int, counts)) == pytest.approx(n_hang, abs=1)


def told_to_do(browser: Any, path: Path, document: dict[str, Any]) -> list[str]:
    """The lines below the fourth question."""
    with opened(browser, write_page(path, document)) as page:
        lines: list[str] = page.locator(".answer").last.locator("p").all_inner_texts()
    return lines


@pytest.mark.parametrize(
    ("harvest", "said"),
    [
        (None, "Record the row again in a week or two"),
        ("2024-10-20", "Record the row again in a week or two"),
        ("2024-10-01", "Record the row once more before the harvest"),
        ("2024-09-20", None),
    ],
)
def test_the_next_visit_comes_before_the_harvest(browser: Any, tmp_path: Path, harvest: str | None, said: str) -> None:
    document = drawn_document(200, with_pictures=False)
    document["harvest"] = document["growth"]["harvest"] = harvest
    document["growth"]["days"][-1] = harvest or "2024-09-17"
    lines = told_to_do(browser, tmp_path / "report.html", document)
    assert [line for line in lines if line.startswith("Record")] == ([said] if said else [])


@pytest.mark.parametrize(
    ("days", "has_diameters", "harvest", "said"),
    [
        ((80,), True, None, "Record the row again in a week or two: two dates show growth"),
        ((80,), True, date(2024, 7, 30), "Record the row once more before the harvest: two dates show growth"),
        ((80,), True, date(2024, 7, 17), "Harvest on 17\N{NO-BREAK SPACE}Jul"),
        (
            (80, 95),
            False,
            None,
            "Record the row again in a week or two, with diameters: those of two dates show growth",
        ),
    ],
)
def test_what_growth_needs_is_said_once(
    browser: Any, tmp_path: Path, days: tuple[int, ...], has_diameters: bool, harvest: date | None, said: str
) -> None:
    path = grow_row(tmp_path / "orchard.gpkg", days, n_trees=1).path
    if not has_diameters:
        with contextlib.closing(geopackage.connect(path)) as connection, connection:
            connection.execute("UPDATE observations SET diameter_m = NULL")
    document = season_document(path, Wishes(harvest=harvest))
    assert told_to_do(browser, tmp_path / "report.html", document) == [said]


def test_what_is_too_large_is_not_to_be_thinned(browser: Any, grown_row: GrownRow, tmp_path: Path) -> None:
    document = season_document(grown_row.path, Wishes(harvest=date(2024, 9, 1), target=20))
    assert not document["thinning"]["are_fruitlets"]
    first, *others = told_to_do(browser, tmp_path / "late.html", document)
    assert re.fullmatch(r"Plan \d+ packs for 1\N{NO-BREAK SPACE}Sept", first)
    assert f"Too large to thin: {N - 60} beyond 20 a tree" in others
    document["thinning"]["are_fruitlets"] = True
    assert told_to_do(browser, tmp_path / "early.html", document)[0] == f"Thin {N - 60} fruits"


def test_visits_too_close_to_tell_what_drops_say_so(browser: Any, tmp_path: Path) -> None:
    path = grow_row(tmp_path / "orchard.gpkg", (30, 31), n_trees=1, noise_mm=2.0).path
    write_report(path, tmp_path / "report.html", Wishes())
    with opened(browser, (tmp_path / "report.html").as_uri()) as page:
        page.get_by_role("tab", name="Thinning").click()
        said = page.locator("#panel-thinning").inner_text()
    assert "Cannot tell which fruits will drop" in said
    assert "mm a day" not in said


def test_one_visit_shows_its_sizes(browser: Any, tmp_path: Path) -> None:
    path = grow_row(tmp_path / "orchard.gpkg", (80,), n_trees=2).path
    fruits = OrchardMap(path).fruits()
    sizes_mm, trees = 1000.0 * fruits.diameters_m, np.array(bearing_trees(fruits).of_fruits())
    write_report(path, tmp_path / "report.html", Wishes())
    with opened(browser, (tmp_path / "report.html").as_uri()) as page:
        shown = [line.split()[-2:] for line in page.locator(".trees tbody tr").all_inner_texts()]
        assert shown == [[f"{sizes_mm[trees == name].mean():.1f}", "\N{EN DASH}"] for name in ("1", "2")]
        counts = page.locator(".sizes td:last-child").all_inner_texts()
        assert sum(map(int, counts)) == pytest.approx(hang_chances(fruits).sum(), abs=2), "each is rounded"
        assert int(counts[-1]) == (sizes_mm >= 60.0).sum()
        page.get_by_role("tab", name="Sizes").click()
        table = page.locator("#panel-sizes table")
        assert "14 Jul 2024" in table.inner_text()
        assert table.locator("tbody tr").all_inner_texts()[-1].split()[:5] == ["60", "to", "65", "mm", counts[-1]]
        assert "(" not in table.inner_text(), "one visit has no intervals"


@pytest.mark.parametrize("width", [390, 1280, 1440, 1920])
def test_the_numbers_of_trees_stay_in_view(browser: Any, grown_row: GrownRow, tmp_path: Path, width: int) -> None:
    """With a harvest and a target, however long the names of trees are: they are cut, and whole in the title."""
    document = season_document(grown_row.path, Wishes(harvest=date(2024, 9, 30), target=20))
    names = ["12", "the old Gravenstein behind the gate, second from the left", "w" * 400]
    for number, name in enumerate(names):
        document["trees"][number]["name"] = document["growth"]["blocks"][1 + number]["name"] = name
    address = write_page(tmp_path / "report.html", document)
    with opened(browser, address, viewport={"width": width, "height": 860}) as page:
        assert page.locator(".trees thead th").all_inner_texts() == ["Tree", "Fruits", "mm", "a day", "30 Sept", "thin"]
        spans = page.locator(".trees .scroll").evaluate("box => [box.scrollWidth, box.clientWidth]")
        assert spans[0] <= spans[1]
        buttons = page.locator(".trees tbody th button")
        assert buttons.evaluate_all("all => all.map(one => one.title)") == [f"Tree {name}" for name in names]
        cut = buttons.evaluate_all("all => all.map(one => one.scrollWidth > one.clientWidth)")
        assert cut == [False, True, True]


def test_the_fruits_of_no_tree_have_no_mean_of_all(browser: Any, tmp_path: Path) -> None:
    """The block of all fruits has no name, as the one of those of no tree; of these none hangs any more."""
    document = drawn_document(300, with_pictures=False)
    document["trees"][2] |= {"name": "", "n_hang": 0.0}
    document["fruits"]["state"] = packed(np.repeat([1, 1, 3], 100))
    document["fruits"]["state_probability"] = packed(np.ones(300), 0.001)
    document["growth"]["blocks"] = document["growth"]["blocks"][:3]
    with opened(browser, write_page(tmp_path / "report.html", document)) as page:
        lines = [line.split("\t") for line in page.locator(".trees tbody tr").all_inner_texts()]
        means = [block["mean_mm"] for block in document["growth"]["blocks"][1:]]
        assert [line[2] for line in lines[:2]] == [f"{mean[-2]:.1f}" for mean in means]
        assert lines[2] == ["No tree", "0", *["\N{EN DASH}"] * 3]


@pytest.mark.parametrize(
    ("measured", "big", "fast", "card"),
    [
        (2, "mm on average on 29 Jun", "mm a day on 29 Jun", "On 29 Jun"),
        (1, "mm on average on 14 Jun", "sizes of one day only, 2024-06-14", "On 14 Jun"),
        (3, "mm on average", "mm a day", "Now"),
    ],
)
def test_old_sizes_have_their_day(browser: Any, tmp_path: Path, measured: int, big: str, fast: str, card: str) -> None:
    """Only the first visits measured: nothing that the page tells of sizes is of now."""
    path = grow_row(tmp_path / "orchard.gpkg", (50, 65, 80), n_trees=2).path
    with contextlib.closing(geopackage.connect(path)) as connection, connection:
        connection.execute("UPDATE observations SET diameter_m = NULL WHERE session_id > ?", (measured,))
    warned: list[str] = []
    write_report(path, tmp_path / "report.html", Wishes(), warned.append)
    with opened(browser, (tmp_path / "report.html").as_uri()) as page:
        answers = [" ".join(text.split()) for text in page.locator(".answer").all_inner_texts()]
        page.get_by_role("tab", name="Fruits").click()
        table = page.locator("#panel-fruits")
        table.get_by_role("row").nth(1).click()
        names = page.locator(".fruit-card dt").all_inner_texts()
        heads = page.locator("#panel-fruits [role=columnheader]").all_inner_texts()
    assert re.search(f"{big}(?! on)", answers[1])
    assert re.search(f"{fast}(?! on)", answers[2])
    assert card in names
    assert ("Now" in names) == (measured == 3)
    assert ("mm now" in " ".join(heads)) == (measured == 3)
    assert len(warned) == (measured < 3)
    assert all(line.startswith("no sizes on 2024-0") for line in warned)


def test_a_fruit_that_has_stopped_says_so(browser: Any, tmp_path: Path) -> None:
    document = drawn_document(100, with_pictures=False)
    document["growth"]["stopped"] = packed(np.full(100, 0.9), 0.001)
    with opened(browser, write_page(tmp_path / "report.html", document)) as page:
        page.get_by_role("tab", name="Fruits").click()
        page.locator("#panel-fruits").get_by_role("row").nth(1).click()
        card = " ".join(page.locator(".fruit-card dl").last.inner_text().split())
    assert "Stopped it has stopped growing, 90 % sure" in card
