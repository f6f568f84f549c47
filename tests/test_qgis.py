"""A map in QGIS itself: its layers open, and their default styles draw."""

from pathlib import Path

from growth_maker import grow_row
from pomona.orchard import OrchardMap
from qgis_program import require_qgis, seen_by_qgis


def test_qgis_opens_a_map_coloured_by_growth(tmp_path: Path) -> None:
    require_qgis()
    path = grow_row(tmp_path / "orchard.gpkg").path
    layers = [f"{path}|layername={name}" for name in ("fruits", "observations")]
    fruits, observations = seen_by_qgis("ogr", *layers, home=tmp_path)
    assert (fruits["valid"], observations["valid"]) == (True, True)
    assert fruits["count"] == len(OrchardMap(path).fruits())
    assert "0.4 to 0.6 mm a day" in fruits["legend"]
    assert {"#21918c", "#5ec962"} <= set(fruits["colours"]), "fruits of two rates, in their colours"
