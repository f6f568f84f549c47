"""The page in a real browser: what a grower does, what a stranger's map tries."""

import contextlib
import csv
import http.server
import re
import shutil
import threading
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.page_draw import drawn_document

from growth_maker import FRUITS_OF_TREE, GrownRow, grow_row
from page_maker import opened, served, write_page
from pomona import FruitCloud, geopackage
from pomona.growth.season_growth import grow_season
from pomona.orchard import OrchardMap, Session, add_session
from pomona.viewer.packed_columns import packed
from pomona.viewer.season_page import Wishes
from pomona.viewer.season_report import write_report
from test_calipers import long_table

AXE = Path(__file__).parents[1] / "web" / "node_modules" / "axe-core" / "axe.min.js"


HOSTILE = '</script><img src=x onerror="window.owned=1"><b>\'&quot;\u202e\x1b[31m%s' + "w" * 3000


N = 3 * FRUITS_OF_TREE


@pytest.fixture(scope="module")
def report(grown_row: GrownRow, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("report")
    calipers = long_table(grown_row, folder / "calipers.csv")
    write_report(grown_row.path, folder / "report.html", Wishes(harvest=date(2024, 9, 1), target=20, calipers=calipers))
    return folder / "report.html"


@pytest.fixture
def page(browser: Any, report: Path) -> Iterator[Any]:
    with opened(browser, report.as_uri()) as found:
        yield found


def shown_rows(page: Any) -> list[list[str]]:
    """The texts of the rows that stand there, read in one go: the table draws its rows anew as it likes."""
    texts_of = "lines => lines.map(line => Array.from(line.querySelectorAll('[role=cell]'), cell => cell.innerText))"
    rows: list[list[str]] = page.locator(".lines .line").evaluate_all(texts_of)
    return rows


def lefts_of(page: Any, role: str) -> list[float]:
    """Where the first cells of that role begin, one for each column, read in one go.

    In one go, for a table that was just scrolled draws its rows anew: cells found first and
    measured afterwards may be off the page by then.
    """
    page.locator(f"[role=table] [role={role}]").first.wait_for()
    lefts: list[float] = page.evaluate(
        """role => {
            const found = document.querySelectorAll(`[role=table] [role=${role}]`);
            return [...found].map(cell => Math.round(cell.getBoundingClientRect().x));
        }""",
        role,
    )
    return lefts[: page.locator("[role=columnheader]").count()]


def wait_for(locator: Any, text: str) -> None:
    from playwright.sync_api import expect

    expect(locator).to_contain_text(text, timeout=20_000)


def touch_a_fruit(page: Any) -> None:
    """Click here and there in the row, as one does who cannot aim, until a fruit is hit."""
    box = page.locator("canvas").first.bounding_box()
    for y in range(4, 9):
        for x in range(10, 90):
            page.mouse.move(box["x"] + box["width"] * x / 100, box["y"] + box["height"] * y / 10)
            if page.locator(".tip").is_visible():
                page.mouse.down()
                page.mouse.up()
                return
    pytest.fail("no fruit anywhere in the row")


def test_a_guessed_vertical_is_said(browser: Any, grown_row: GrownRow, report: Path, tmp_path: Path) -> None:
    write_report(grown_row.path, tmp_path / "told.html", Wishes(up=np.array([0.0, 0.0, 1.0])))
    for path, times in ((report, 1), (tmp_path / "told.html", 0)):
        with opened(browser, path.as_uri()) as page:
            assert page.locator("#panel-row").inner_text().count("Which way is up is guessed") == times


@pytest.mark.parametrize("width", [1280, 390])
def test_the_head_of_the_table_stands_over_its_columns(browser: Any, report: Path, width: int) -> None:
    with opened(browser, report.as_uri(), viewport={"width": width, "height": 700}) as page:
        page.get_by_role("tab", name="Fruits").click()
        heads = lefts_of(page, "columnheader")
        assert len(heads) >= 10
        assert lefts_of(page, "cell") == heads
        top = page.locator(".heads").bounding_box()["y"]
        page.locator(".scroller").evaluate("all => all.scrollTo(50, all.scrollHeight)")
        assert page.locator(".heads").bounding_box()["y"] == top
        assert lefts_of(page, "cell") == lefts_of(page, "columnheader")


def test_the_titles_of_columns_are_whole(browser: Any, grown_row: GrownRow, tmp_path: Path) -> None:
    """September is the longest of months, and an arrow stands behind the title that sorts."""
    write_report(grown_row.path, tmp_path / "report.html", Wishes(harvest=date(2024, 9, 30), target=20))
    right = "getBoundingClientRect().right"
    left = f"all => all.map(one => one.{right} - one.querySelector('button').{right})"
    with opened(browser, (tmp_path / "report.html").as_uri()) as page:
        page.get_by_role("tab", name="Fruits").click()
        heads = page.get_by_role("columnheader")
        titles = heads.all_inner_texts()
        assert "mm, 30 Sept" in titles
        for number, title in enumerate(titles):
            heads.nth(number).get_by_role("button").click()
            assert heads.nth(number).inner_text().split()[-1] in ("\N{UPWARDS ARROW}", "\N{DOWNWARDS ARROW}")
            assert min(heads.evaluate_all(left)) >= 0, title


def test_the_slider_goes_through_the_season(page: Any) -> None:
    last = page.locator("canvas").first.screenshot()
    assert "visit 4 of 4" in page.locator(".when").inner_text()
    slider = page.get_by_label("Date", exact=True)
    slider.fill("0")
    assert "visit 1 of 4" in page.locator(".when").inner_text()
    page.wait_for_timeout(300)
    assert page.locator("canvas").first.screenshot() != last
    slider.focus()
    page.keyboard.press("End")
    assert "foretold" in page.locator(".when").inner_text()
    page.get_by_label("Play the season").click()
    wait_for(page.locator(".when"), "visit 2")
    page.get_by_label("Pause").click()


def test_a_touched_fruit_shows_its_card(page: Any, grown_row: GrownRow) -> None:
    touch_a_fruit(page)
    card = page.locator(".fruit-card").first
    fruit_id = int(re.search(r"Fruit (\d+)", card.inner_text())[1])
    seen = OrchardMap(grown_row.path).observations()
    sizes_mm = 1000.0 * seen.diameters_m[seen.fruit_ids == fruit_id]
    shown = [float(cell) for cell in card.locator(".sights td:nth-child(3)").all_inner_texts()]
    assert shown == pytest.approx(sizes_mm.tolist(), abs=0.11)
    card.locator(".curve canvas").wait_for()
    assert "90 %" in card.locator(".curve").get_attribute("aria-label")
    card.get_by_label("Close").click()
    assert page.locator(".fruit-card").count() == 0


def test_the_table_filters_sorts_and_is_saved(page: Any, grown_row: GrownRow, tmp_path: Path) -> None:
    page.get_by_role("tab", name="Fruits").click()
    assert page.locator(".filter-bar output").inner_text() == f"{N} of {N} fruits"
    assert len(shown_rows(page)) < N, "only what is on the screen is in the page"
    page.get_by_label("Tree", exact=True).select_option(label="Tree 2")
    assert page.locator(".filter-bar output").inner_text() == f"{FRUITS_OF_TREE} of {N} fruits"
    page.get_by_role("button", name="mm now").click()
    sizes = [float(cells[5]) for cells in shown_rows(page)]
    assert sizes == sorted(sizes)
    page.get_by_role("button", name="mm now").click()
    largest = max(float(line["diameter_mm"]) for line in saved(page, tmp_path))
    assert float(shown_rows(page)[0][5]) == pytest.approx(largest, abs=0.06)
    lines = saved(page, tmp_path)
    assert {line["tree"] for line in lines} == {"2"}
    fruits = OrchardMap(grown_row.path).fruits()
    place_of = dict(zip(fruits.ids, fruits.positions, strict=True))
    for line in lines:
        found = [float(line[axis]) for axis in "xyz"]
        assert found == pytest.approx(place_of[line["fruit_id"]].tolist(), abs=0.002)


def test_what_is_saved_is_what_the_verbs_say(page: Any, grown_row: GrownRow, tmp_path: Path) -> None:
    """To the step in which it is told, tenths of a millimetre: nothing is moved by where a column begins."""
    growth = grow_season(grown_row.path, harvest=date(2024, 9, 1))
    row_of = {str(fruit): number for number, fruit in enumerate(growth.fruits.ids.tolist())}
    page.get_by_role("tab", name="Fruits").click()
    lines = saved(page, tmp_path)
    assert len(lines) == N
    for line in lines:
        sizes_mm = growth.foretold.sizes_mm[row_of[line["fruit_id"]]]
        assert float(line["forecast_mm"]) == round(float(sizes_mm[-1]), 1)
        assert float(line["diameter_mm"]) == round(float(sizes_mm[-2]), 1)
        assert 0.0 <= float(line["state_probability"]) <= 1.0
        assert all(len(line[axis].partition(".")[2]) <= 3 for axis in "xyz")


def saved(page: Any, folder: Path, name: str = "orchard-fruits.csv") -> list[dict[str, str]]:
    with page.expect_download() as download:
        page.get_by_role("button", name="Save CSV").click()
    assert download.value.suggested_filename == name
    download.value.save_as(folder / "saved.csv")
    with (folder / "saved.csv").open(newline="") as file:
        return list(csv.DictReader(file))


def test_everything_goes_with_keys(page: Any) -> None:
    page.get_by_role("tab", name="Row").focus()
    page.keyboard.press("ArrowRight")
    assert page.get_by_role("tab", name="Fruits").get_attribute("aria-selected") == "true"
    page.get_by_role("table", name="Fruits").focus()
    page.keyboard.press("ArrowDown")
    page.keyboard.press("ArrowDown")
    assert shown_rows(page)[1][0] == re.search(r"Fruit (\d+)", page.locator("#panel-fruits h2").inner_text())[1]
    page.get_by_role("tab", name="Row").click()
    canvas = page.locator("#panel-row canvas").first
    canvas.focus()
    page.wait_for_timeout(300)
    before = canvas.screenshot()
    page.keyboard.press("d")
    page.keyboard.press("+")
    page.wait_for_timeout(300)
    assert canvas.screenshot() != before


def test_thinning_follows_the_target(page: Any) -> None:
    page.get_by_role("tab", name="Thinning").click()
    to_thin = page.locator("#panel-thinning .total td:nth-child(5)")
    before = int(to_thin.inner_text())
    page.get_by_label("Each tree shall keep").fill("10")
    stay = int(page.locator("#panel-thinning .total td:nth-child(4)").inner_text())
    assert int(to_thin.inner_text()) == stay - 30 > before
    page.get_by_role("button", name="List them").click()
    assert page.locator(".filter-bar output").inner_text() == f"{stay - 30} of {N} fruits"


def test_two_dates_and_calipers_are_told(page: Any) -> None:
    page.get_by_role("tab", name="Two dates").click()
    page.wait_for_selector("#panel-dates canvas")
    page.get_by_label("Date above").select_option(index=0)
    wait_for(page.locator("#panel-dates [role=status]"), f"{N} fruits on both")
    page.get_by_role("tab", name="Calipers").click()
    assert page.locator("#panel-calipers circle").count() == 4 * N
    assert page.locator("#panel-calipers tbody tr").first.inner_text().split()[1] == str(4 * N)


def test_two_dates_begin_with_visits_to_the_same_row(browser: Any, tmp_path: Path) -> None:
    """Two rows, both recorded on two days: the two last visits of the map are to different rows."""
    rng = np.random.default_rng(3)
    rows = {
        name: rng.uniform((0, 6 * k, 0), (8, 6 * k + 0.5, 2), (60 + k, 3)) for k, name in enumerate(("east", "west"))
    }
    path = tmp_path / "rows.gpkg"
    for day in ("2024-08-01", "2024-09-01"):
        for name, places in rows.items():
            cloud = FruitCloud(places + rng.normal(0, 0.003, places.shape))
            assert add_session(path, Session(f"{name} {day[5:7]}", day, "drawn", cloud), new_part=True).is_added
    write_report(path, tmp_path / "report.html", Wishes())
    with opened(browser, (tmp_path / "report.html").as_uri()) as page:
        page.get_by_role("tab", name="Two dates").click()
        wait_for(
            page.locator("#panel-dates [role=status]"), "61 fruits on both dates; 0 fruits on 1 Aug 2024, west 08 only"
        )
        options = page.get_by_label("Date above").locator("option").all_inner_texts()
        assert options == [f"1 Aug 2024, {row} 08" for row in rows] + [f"1 Sept 2024, {row} 09" for row in rows]
        assert [page.get_by_label(f"Date {one}").input_value() for one in ("above", "below")] == ["1", "3"]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_axe_finds_nothing_serious(browser: Any, report: Path, scheme: str) -> None:
    if not AXE.exists():
        pytest.skip(f"no axe-core: {AXE} is not there; make page")
    with opened(browser, report.as_uri(), color_scheme=scheme, bypass_csp=True) as page:
        page.add_script_tag(path=str(AXE))
        touch_a_fruit(page)
        for tab in ("Row", "Fruits", "Two dates", "Sizes", "Thinning", "Calipers"):
            page.get_by_role("tab", name=tab).click()
            page.wait_for_timeout(200)
            found = page.evaluate("axe.run(document, {resultTypes: ['violations']})")["violations"]
            serious = [one for one in found if one["impact"] in ("serious", "critical")]
            assert [(one["id"], one["nodes"][0]["html"][:160]) for one in serious] == [], tab


def test_a_phone_shows_it_without_scrolling_sideways(browser: Any, report: Path) -> None:
    with opened(browser, report.as_uri(), viewport={"width": 390, "height": 844}, has_touch=True) as page:
        for tab in ("Row", "Fruits", "Two dates", "Sizes", "Thinning", "Calipers"):
            page.get_by_role("tab", name=tab).click()
            assert page.evaluate("document.documentElement.scrollWidth") <= 390, tab


@pytest.fixture(scope="module")
def hostile(tmp_path_factory: pytest.TempPathFactory) -> GrownRow:
    """A map whose names all try to be more than names."""
    path = tmp_path_factory.mktemp("hostile") / "<img src=x onerror=alert(1)>'\u202egkpg.gpkg"
    return grow_row(path, (50, 65), n_trees=1, labels=HOSTILE + " {}", name=HOSTILE + " {}")


def test_names_of_strangers_are_texts(browser: Any, hostile: GrownRow, tmp_path: Path) -> None:
    calipers = tmp_path / "=calipers<b>.csv"
    with calipers.open("w", newline="") as file:
        csv.writer(file).writerows([("label", "date", "diameter_mm"), (f"{HOSTILE} 7", hostile.day(50), 40)])
    write_report(hostile.path, tmp_path / "report.html", Wishes(calipers=calipers))
    with opened(browser, (tmp_path / "report.html").as_uri()) as page:
        assert_harmless(page, hostile)
        page.get_by_role("tab", name="Calipers").click()
        assert HOSTILE in page.locator("circle title").first.text_content()
        assert_harmless(page, hostile)


def test_names_of_strangers_are_texts_from_the_server_too(browser: Any, hostile: GrownRow) -> None:
    with served(hostile.path) as address, opened(browser, address) as page:
        assert_harmless(page, hostile)


def test_names_of_trees_are_texts_in_the_page_and_in_a_spreadsheet(browser: Any, tmp_path: Path) -> None:
    document = drawn_document(300, with_pictures=False)
    names = [HOSTILE, "=1+1", '@"a,b"']
    for number, name in enumerate(names):
        document["trees"][number]["name"] = document["growth"]["blocks"][1 + number]["name"] = name
    with opened(browser, write_page(tmp_path / "report.html", document)) as page:
        assert page.locator(".trees tbody th").all_text_contents() == [f"Tree {name}" for name in names]
        page.get_by_role("tab", name="Fruits").click()
        with page.expect_download() as download:
            page.get_by_role("button", name="Save CSV").click()
        with Path(download.value.path()).open(newline="", encoding="utf-8") as file:
            trees = {line["tree"] for line in csv.DictReader(file)}
        assert trees == {HOSTILE, "'=1+1", '\'@"a,b"'}
        assert page.evaluate("window.owned") is None


def test_fruits_and_trees_go_by_their_rows(browser: Any, tmp_path: Path) -> None:
    """Rows are in the order that they are told in: 2 before 10, by number."""
    document = drawn_document(400, with_pictures=False)
    for name in ("state_probability", "fruit_probability"):
        document["fruits"][name] = packed(np.ones(400), 0.001)
    for tree, row in zip(document["trees"], ("row 2", "row 2", "row 10", "row 10"), strict=True):
        tree["row"] = row
    document["growth"]["blocks"].append({**document["growth"]["blocks"][0], "kind": "row", "name": "row 10"})
    with opened(browser, write_page(tmp_path / "report.html", document)) as page:
        heads = ["row 2", "Tree 0", "Tree 1", "row 10", "Tree 2", "Tree 3"]
        assert page.locator(".trees tbody th").all_text_contents() == heads
        assert page.locator(".trees .of-row td").all_inner_texts()[:1] == ["200"]
        page.get_by_role("tab", name="Fruits").click()
        assert page.get_by_role("columnheader").nth(1).inner_text() == "Row"
        page.get_by_role("button", name="Row", exact=True).click()
        page.get_by_role("button", name="Row ↑", exact=True).click()
        assert {cells[1] for cells in shown_rows(page)} == {"row 10"}
        page.locator('select[aria-label="Row"]').select_option("row 2")
        assert page.locator(".filter-bar output").inner_text() == "200 of 400 fruits"
        assert {cells[1] for cells in shown_rows(page)} == {"row 2"}
        assert {line["row"] for line in saved(page, tmp_path, "400_fruits-fruits.csv")} == {"row 2"}


def test_what_is_gone_has_no_size_now(browser: Any, grown_row: GrownRow, tmp_path: Path) -> None:
    path = tmp_path / "orchard.gpkg"
    shutil.copy(grown_row.path, path)
    with contextlib.closing(geopackage.connect(path)) as connection, connection:
        sessions = [number for (number,) in connection.execute("SELECT id FROM sessions ORDER BY date")]
        connection.execute("UPDATE fruits SET state = 'gone', last_session_id = ? WHERE id = 7", (sessions[1],))
        connection.execute("DELETE FROM observations WHERE fruit_id = 7 AND session_id IN (?, ?)", sessions[2:])
    write_report(path, tmp_path / "report.html", Wishes(harvest=date(2024, 9, 1)))
    with opened(browser, (tmp_path / "report.html").as_uri()) as page:
        page.get_by_role("tab", name="Fruits").click()
        page.get_by_label("State").select_option("gone")
        (cells,) = shown_rows(page)
        assert cells[3].endswith("\N{NO-BREAK SPACE}%")
        assert set(cells[5:]) == {"\N{EN DASH}"}
        page.locator(".lines .line").first.click()
        card = page.locator(".fruit-card").first
        assert "Now" not in card.locator("dt").all_inner_texts()
        said = card.locator(".curve").get_attribute("aria-label")
        assert re.fullmatch(r"Growth curve .* from [\d.]+ mm on 14 Jun 2024 to [\d.]+ mm on 29 Jun 2024", said)


def assert_harmless(page: Any, hostile: GrownRow) -> None:
    assert page.locator("h1").text_content() == hostile.path.name
    assert page.evaluate("window.owned") is None
    assert page.locator("img, b").count() == 0
    assert page.evaluate("document.scripts.length") <= 2
    assert page.evaluate("document.documentElement.scrollWidth") <= 1280


def test_a_page_from_elsewhere_learns_nothing(browser: Any, grown_row: GrownRow, tmp_path: Path) -> None:
    (tmp_path / "index.html").write_text("<!doctype html><title>elsewhere</title>")
    with served(grown_row.path) as address, elsewhere(tmp_path) as foreign:
        context = browser.new_context()
        page = context.new_page()
        page.goto(foreign)
        for mode in ("cors", "no-cors"):
            ask = f"fetch('{address}season.json', {{mode: '{mode}'}}).then((r) => r.text()).catch(() => '')"
            assert page.evaluate(ask) == ""
        load = f"""new Promise((done) => {{
            const script = document.createElement('script');
            script.onload = () => done('run'); script.onerror = () => done('refused');
            script.src = '{address}page.js'; document.head.append(script); }})"""
        assert page.evaluate(load) == "refused"
        page.evaluate(f"document.body.append(Object.assign(document.createElement('iframe'), {{src: '{address}'}}))")
        page.wait_for_timeout(500)
        assert all("pomona" not in frame.content().lower() for frame in page.frames[1:])
        context.close()


@contextlib.contextmanager
def elsewhere(folder: Path) -> Iterator[str]:
    class Quiet(http.server.SimpleHTTPRequestHandler):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments, directory=str(folder))

        def log_message(self, *_: Any) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Quiet) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{server.server_port}/"
        server.shutdown()
