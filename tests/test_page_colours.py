"""Nothing on the page is told by colour alone: who sees none of them tells states, plans and dates by shapes."""

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from benchmarks.page_draw import VISITS, drawn_document

from page_maker import opened, write_page
from pomona.viewer.packed_columns import packed

N = 24
LAST = VISITS - 1
STATES = ("new", "seen", "missed", "gone")
SIGHTS = {"new": (LAST,), "seen": (0, LAST), "missed": (0,), "gone": (0,)}
ALIKE = 0.001
"""Share of the pixels by which two pictures of the same shapes differ, at rims."""


def drawn(visits: tuple[int, ...], *, state: str = "seen", probability: float = 1.0) -> dict[str, Any]:
    """A tree without a name, so that nothing is written over it: all of its fruits were seen on these visits."""
    document = drawn_document(N, with_pictures=False)
    document["trees"][0]["name"] = ""
    fruit, visit = np.repeat(np.arange(N), len(visits)), np.tile(visits, N)
    rng = np.random.default_rng(1)
    places = np.repeat(rng.uniform((0, 0, 0), (1.5, 0.3, 1), (N, 3)), len(visits), axis=0)
    document["sights"] = {
        "fruit": packed(fruit),
        "visit": packed(visit),
        **{axis: packed(places[:, column], 0.001) for column, axis in enumerate("xyz")},
        "diameter_mm": packed(np.full(len(fruit), 70.0), 0.1),
        "probability": packed(np.full(len(fruit), probability), 0.001),
    }
    document["fruits"]["state"] = packed(np.full(N, STATES.index(state)))
    return document


def planned(place: float, cluster_size: float) -> dict[str, Any]:
    """All fruits at one place among those that their tree keeps, of which there shall be five."""
    columns = ("cluster", "cluster_size", "rate_mm_per_day", "drop_probability", "place")
    values = {name: packed(np.full(N, cluster_size)) for name in columns} | {"place": packed(np.full(N, place))}
    days = {"from": "2024-06-01", "to": "2024-06-13"}
    thinning = {"target": 5, "are_fruitlets": True, "is_told": True, "fast_mm_per_day": 0.5, **days, **values}
    return {**drawn((0, LAST)), "thinning": thinning}


def shapes(locator: Any) -> np.ndarray:
    """A picture without its colours: 0 where nothing is, 1 where it is dark, 2 where it has some colour."""
    pixels = cv2.imdecode(np.frombuffer(locator.screenshot(), np.uint8), cv2.IMREAD_COLOR)
    return np.where(pixels.min(axis=2) > 195, 0, np.where(pixels.max(axis=2) < 60, 1, 2))


def row_in(browser: Any, path: Path, document: dict[str, Any], colour: str) -> tuple[np.ndarray, list[str]]:
    """The shapes of the row, and of the key below it."""
    with opened(browser, write_page(path, document)) as page:
        page.get_by_role("button", name=colour, exact=True).click()
        page.wait_for_timeout(300)
        return shapes(page.locator("#panel-row canvas")), keys(page.locator(".legend .swatch"))


def keys(swatches: Any) -> list[str]:
    """What is drawn beside each word of a key, without its colours."""
    shape = 'one => one.outerHTML.replace(/ (fill|stroke)="(rgb|#)[^"]*"/g, \'\')'
    found: list[str] = swatches.locator("svg").evaluate_all(f"all => all.map({shape})")
    return found


def assert_all_differ(pictures: list[np.ndarray]) -> None:
    for number, one in enumerate(pictures):
        assert (one > 0).any()
        assert min([np.mean(one != other) for other in pictures[:number]], default=1.0) > ALIKE


def pieces(picture: np.ndarray) -> int:
    """How many things are drawn that do not touch."""
    return int(cv2.connectedComponents((picture > 0).astype(np.uint8))[0]) - 1


def test_states_are_told_without_colours(browser: Any, tmp_path: Path) -> None:
    drawings = [drawn(SIGHTS[state], state=state) for state in STATES]
    pictures = [row_in(browser, tmp_path / "report.html", one, "State") for one in drawings]
    assert_all_differ([picture for picture, _ in pictures])
    assert len(set(pictures[0][1])) == len(STATES)


def test_what_another_visit_of_the_day_saw_is_no_ring(browser: Any, tmp_path: Path) -> None:
    """Each visit goes along a row of its own: what the last one did not see has not hid from that day."""
    whole, parted = drawn((0, LAST)), drawn((0, LAST))
    visit = np.where(np.arange(2 * N) % 4 == 1, LAST - 1, np.tile((0, LAST), N))
    parted["sights"]["visit"] = packed(visit)
    for document in (whole, parted):
        document["visits"][LAST - 1]["date"] = document["visits"][LAST]["date"]
    (one, _), (other, _) = (row_in(browser, tmp_path / "report.html", each, "State") for each in (whole, parted))
    assert np.mean(one != other) < ALIKE


def test_plans_are_told_without_colours(browser: Any, tmp_path: Path) -> None:
    keep, thin, drops, unknown = (1.0, 1.0), (9.0, 1.0), (np.nan, 1.0), (np.nan, np.nan)
    pictures = [
        row_in(browser, tmp_path / "report.html", planned(*how), "Thinning") for how in (keep, thin, drops, unknown)
    ]
    assert_all_differ([picture for picture, _ in pictures])
    assert len(set(pictures[0][1])) == 4


def test_what_does_not_grow_is_told_without_colours(browser: Any, tmp_path: Path) -> None:
    documents = [drawn((0, LAST)), drawn((0, LAST))]
    for document, rate in zip(documents, (0.4, np.nan), strict=True):
        document["growth"]["rate_mm_per_day"] = packed(np.full(N, rate), 0.001)
    (known, key), (unknown, longer) = (row_in(browser, tmp_path / "r.html", one, "Growth") for one in documents)
    assert_all_differ([known, unknown])
    assert (len(set(key)), len(set(longer))) == (1, 2)


def test_dates_are_told_without_colours(browser: Any, tmp_path: Path) -> None:
    pictures = []
    for visits, probability in (((1, 8), 1.0), ((1, 8), 0.5), ((1,), 1.0), ((8,), 1.0)):
        address = write_page(tmp_path / "report.html", drawn(visits, probability=probability))
        with opened(browser, address) as page:
            page.get_by_role("tab", name="Two dates").click()
            page.get_by_label("Date above").select_option(index=1)
            page.get_by_label("Date below").select_option(index=8)
            page.wait_for_timeout(300)
            pictures.append(shapes(page.locator("#panel-dates canvas")))
            key = keys(page.locator("#panel-dates .swatch"))
    sure, unsure, above, below = pictures
    assert pieces(unsure) > 10 * N > pieces(sure), "dashes"
    assert_all_differ([above, np.flipud(below)])
    assert not (sure == 1).any(), "on both dates: no mark"
    assert (above == 1).any()
    assert (below == 1).any()
    assert len(set(key)) == 4


def test_the_view_that_keys_choose_is_pressed(browser: Any, tmp_path: Path) -> None:
    with opened(browser, write_page(tmp_path / "report.html", drawn((0, LAST)))) as page:
        buttons = page.get_by_role("group", name="View").locator("button")
        canvas = page.locator("#panel-row canvas")
        for key, chosen in (("2", "Above"), ("1", "Side"), ("d", "3D"), ("1", "Side"), ("+", "Side"), ("3", "3D")):
            canvas.press(key)
            pressed = buttons.evaluate_all(
                "all => all.filter(one => one.ariaPressed === 'true').map(one => one.innerText)"
            )
            assert pressed == [chosen], key
        buttons.first.click()
        assert buttons.first.get_attribute("aria-pressed") == "true"
