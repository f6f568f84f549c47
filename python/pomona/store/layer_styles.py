"""How QGIS shall draw the layers: its table of styles, with one default for each layer that people look at.

QGIS reads ``layer_styles`` of a GeoPackage when it opens a layer; the styles are its own QML. Colours are those of
Okabe and Ito, and of viridis, which the colour-blind tell apart too.
"""

from __future__ import annotations

import sqlite3
from xml.etree import ElementTree

from pomona import geopackage

__all__ = ["add_styles"]

TABLE = """
CREATE TABLE layer_styles (
    id INTEGER PRIMARY KEY AUTOINCREMENT NOT NULL, f_table_catalog TEXT(256), f_table_schema TEXT(256),
    f_table_name TEXT(256), f_geometry_column TEXT(256), styleName TEXT(30), styleQML TEXT, styleSLD TEXT,
    useAsDefault BOOLEAN, description TEXT, owner TEXT(30), ui TEXT(30),
    update_time DATETIME DEFAULT (strftime('%Y-%m-%dT%H:%M:%fZ','now')));
INSERT INTO gpkg_contents (table_name, data_type, identifier, description, last_change)
VALUES ('layer_styles', 'attributes', 'layer_styles', 'how QGIS draws the layers', '2026-01-01T00:00:00.000Z');
"""
"""As QGIS makes it. It is the user's from then on: never read, and not asked for when a file is opened."""

MADE_ON = "2026-01-01T00:00:00.000Z"
"""Always the same: the same input gives the same file."""

VERSION = "3.34.0-Prizren"
"""Of the QGIS whose QML this is; newer ones read it."""

STATES = {"seen": "0,114,178,255", "new": "230,159,0,255", "missed": "213,94,0,255", "gone": "150,150,150,255"}

RATES_MM_PER_DAY = (
    (-10.0, 0.2, "68,1,84,255"),
    (0.2, 0.4, "59,82,139,255"),
    (0.4, 0.6, "33,145,140,255"),
    (0.6, 0.8, "94,201,98,255"),
    (0.8, 10.0, "253,231,37,255"),
)
UNKNOWN = "190,190,190,255"
TREE, KNOWN_POINT = "0,158,115,255", "0,0,0,255"

FRUIT_MM, TREE_MM = 1.8, 3.2


def add_styles(connection: sqlite3.Connection) -> None:
    """Say how QGIS shall draw the layers, unless somebody has."""
    if connection.execute("SELECT 1 FROM sqlite_master WHERE lower(name) = 'layer_styles'").fetchone() is not None:
        return
    geopackage.execute_all(connection, TABLE)
    styles = [
        (layer, name, qml, int(name == "growth"), about)
        for layer in ("fruits", "fruits_wgs84")
        for name, qml, about in (
            ("growth", _growth(), "fruits by their growth in mm a day; grey where it is not known"),
            ("state", _states(), "fruits by whether they are new, seen, missed or gone"),
        )
    ]
    styles += [(layer, "trees", _labelled(TREE, TREE_MM, "name"), 1, "trees with their names") for layer in TREES]
    styles.append(("control_points", "points", _labelled(KNOWN_POINT, TREE_MM, "name"), 1, "known points"))
    connection.executemany(
        """INSERT INTO layer_styles (f_table_catalog, f_table_schema, f_table_name, f_geometry_column, styleName,
        styleQML, styleSLD, useAsDefault, description, owner, ui, update_time)
        VALUES ('', '', ?, 'geom', ?, ?, '', ?, ?, '', NULL, ?)""",
        ((*style, MADE_ON) for style in styles),
    )


TREES = ("trees", "trees_wgs84")


def _growth() -> str:
    """Return a style that is graduated by the rate of growth, and grey where there is none."""
    root, renderer = _style("RuleRenderer", {"forceraster": "0", "symbollevels": "0"})
    rules = ElementTree.SubElement(renderer, "rules", key="{all}")
    symbols = ElementTree.SubElement(renderer, "symbols")
    column = '"growth_mm_per_day"'
    told = [
        (f"{column} >= {low:g} AND {column} < {high:g}", _between(low, high), colour)
        for low, high, colour in RATES_MM_PER_DAY
    ]
    for number, (asked, label, colour) in enumerate([*told, (f"{column} IS NULL", "not known", UNKNOWN)]):
        ElementTree.SubElement(rules, "rule", key=f"{{{number}}}", filter=asked, label=label, symbol=str(number))
        _marker(symbols, str(number), colour, FRUIT_MM)
    return _text(root)


def _between(low: float, high: float) -> str:
    first, last = RATES_MM_PER_DAY[0], RATES_MM_PER_DAY[-1]
    if low == first[0]:
        return f"under {high:g} mm a day"
    return f"{low:g} mm a day and more" if high == last[1] else f"{low:g} to {high:g} mm a day"


def _states() -> str:
    root, renderer = _style("categorizedSymbol", {"attr": "state", "forceraster": "0", "symbollevels": "0"})
    categories = ElementTree.SubElement(renderer, "categories")
    symbols = ElementTree.SubElement(renderer, "symbols")
    for number, (state, colour) in enumerate(STATES.items()):
        ElementTree.SubElement(
            categories, "category", symbol=str(number), value=state, label=state, type="string", render="true"
        )
        _marker(symbols, str(number), colour, FRUIT_MM)
    return _text(root)


def _labelled(colour: str, size_mm: float, column: str) -> str:
    root, renderer = _style("singleSymbol", {"forceraster": "0", "symbollevels": "0"})
    _marker(ElementTree.SubElement(renderer, "symbols"), "0", colour, size_mm)
    labelling = ElementTree.SubElement(root, "labeling", type="simple")
    settings = ElementTree.SubElement(labelling, "settings", calloutType="simple")
    ElementTree.SubElement(
        settings, "text-style", fieldName=column, isExpression="0", fontSize="9", textColor="0,0,0,255"
    )
    ElementTree.SubElement(settings, "placement", placement="6", dist="1", distUnits="MM")
    return _text(root)


def _style(kind: str, about: dict[str, str]) -> tuple[ElementTree.Element, ElementTree.Element]:
    root = ElementTree.Element("qgis", version=VERSION, styleCategories="Symbology|Labeling", labelsEnabled="1")
    return root, ElementTree.SubElement(root, "renderer-v2", {"type": kind, **about})


def _marker(symbols: ElementTree.Element, name: str, colour: str, size_mm: float) -> None:
    symbol = ElementTree.SubElement(symbols, "symbol", name=name, type="marker", alpha="1", clip_to_extent="1")
    layer = ElementTree.SubElement(
        symbol, "layer", {"class": "SimpleMarker", "enabled": "1", "locked": "0", "pass": "0"}
    )
    options = ElementTree.SubElement(layer, "Option", type="Map")
    look = {"name": "circle", "color": colour, "outline_style": "no", "size": f"{size_mm:g}", "size_unit": "MM"}
    for key, value in look.items():
        ElementTree.SubElement(options, "Option", name=key, value=value, type="QString")


def _text(root: ElementTree.Element) -> str:
    return "<!DOCTYPE qgis PUBLIC 'http://mrcc.com/qgis.dtd' 'SYSTEM'>\n" + ElementTree.tostring(
        root, encoding="unicode"
    )
