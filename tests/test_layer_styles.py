"""What QGIS finds in a map: growth in the layer of fruits, views, and styles that say how to draw them."""

import sqlite3
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pyogrio
import pytest

from growth_maker import grow_row
from pomona.orchard import OrchardMap, problems, remove_session


@pytest.fixture(scope="module")
def orchard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return grow_row(tmp_path_factory.mktemp("row") / "orchard.gpkg", days=(60, 70, 80), n_trees=2, noise_mm=0.2).path


def asked(path: Path, question: str) -> list[tuple[object, ...]]:
    with sqlite3.connect(path) as connection:
        answer = connection.execute(question).fetchall()
    connection.close()
    return answer


def test_growth_is_the_line_through_the_sizes(orchard: Path) -> None:
    rates = dict(asked(orchard, "SELECT id, growth_mm_per_day FROM fruits"))
    seen = OrchardMap(orchard).observations()
    days = np.array([np.datetime64(date) for date in seen.dates]).astype("datetime64[D]").astype(float)
    for fruit in list(rates)[:20]:
        own = seen.fruit_ids == fruit
        assert rates[fruit] == pytest.approx(
            1000.0 * np.polyfit(days[own] - days[0], seen.diameters_m[own], 1)[0], abs=1e-5
        )
    assert 0.1 < np.median(list(rates.values())) < 1.0


def test_growth_follows_a_visit_that_goes(tmp_path: Path) -> None:
    path = grow_row(tmp_path / "orchard.gpkg", days=(60, 70), scales=(1.0, 1.0), n_trees=2).path
    names = [visit.name for visit in OrchardMap(path).visits()]
    assert asked(path, "SELECT count(*) FROM fruits WHERE growth_mm_per_day ISNULL") == [(0,)]
    assert remove_session(path, names[1]) is not None
    assert asked(path, "SELECT count(*) FROM fruits WHERE growth_mm_per_day NOTNULL") == [(0,)]
    assert problems(path) == []


def test_gdal_reads_the_view_with_its_types(orchard: Path) -> None:
    info = pyogrio.read_info(orchard, layer="fruit_series")
    types = dict(zip(info["fields"].tolist(), info["dtypes"].tolist(), strict=True))
    assert types["diameter_m"] == "float64"
    assert types["fruit_id"].startswith("int")
    # A view with a column of times has stopped programs: dates are texts here.
    assert types["date"] == "object"
    assert info["features"] == len(OrchardMap(orchard).observations())
    assert info["geometry_type"] == "Point Z"


def styles(path: Path) -> dict[tuple[str, str], tuple[str, int]]:
    rows = asked(path, "SELECT f_table_name, styleName, styleQML, useAsDefault FROM layer_styles")
    return {(str(layer), str(name)): (str(qml), int(str(default))) for layer, name, qml, default in rows}


def test_each_style_is_of_a_layer_and_one_is_its_default(orchard: Path) -> None:
    found = styles(orchard)
    layers = {name for (name,) in asked(orchard, "SELECT table_name FROM gpkg_contents")}
    columns = asked(orchard, "SELECT DISTINCT f_geometry_column, f_table_schema, f_table_catalog FROM layer_styles")
    # As QGIS asks for them.
    assert columns == [("geom", "", "")]
    assert {layer for layer, _ in found} <= layers
    for layer in {layer for layer, _ in found}:
        assert sum(default for (of, _), (_, default) in found.items() if of == layer) == 1
    assert found["fruits", "growth"][1] == 1


def test_styles_hold_together_and_name_columns_that_are_there(orchard: Path) -> None:
    for (layer, _), (qml, _) in styles(orchard).items():
        root = ElementTree.fromstring(qml)
        assert root.tag == "qgis"
        (renderer,) = root.findall("renderer-v2")
        assert renderer.get("type") in ("RuleRenderer", "categorizedSymbol", "singleSymbol")
        symbols = {symbol.get("name") for symbol in renderer.iter("symbol") if symbol.tag == "symbol"}
        asking = [*renderer.iter("rule"), *renderer.iter("category")]
        assert all(one.get("symbol") in symbols for one in asking)
        there = set(pyogrio.read_info(orchard, layer=layer)["fields"].tolist())
        named = {renderer.get("attr")} | {text.get("fieldName") for text in root.iter("text-style")}
        named |= {rule.get("filter", "").split('"')[1] for rule in renderer.iter("rule")}
        assert named - {None} <= there


def test_every_fruit_has_one_rule_and_one_state(orchard: Path) -> None:
    (qml, _), (states, _) = styles(orchard)["fruits", "growth"], styles(orchard)["fruits", "state"]
    rules = [rule.get("filter") for rule in ElementTree.fromstring(qml).iter("rule")]
    counts = [asked(orchard, f"SELECT count(*) FROM fruits WHERE {rule}")[0][0] for rule in rules]
    assert sum(map(int, map(str, counts))) == asked(orchard, "SELECT count(*) FROM fruits")[0][0]
    values = {category.get("value") for category in ElementTree.fromstring(states).iter("category")}
    assert values == {"new", "seen", "missed", "gone"}
