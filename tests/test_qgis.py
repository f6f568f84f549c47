"""A map in QGIS itself: its layers open, and their default styles draw."""

import json
import subprocess
from pathlib import Path

import pytest

from growth_maker import grow_row
from pomona.orchard import OrchardMap

PYTHON = "/usr/bin/python3"
"""The interpreter that Debian's QGIS is built for."""

LOOK = """
import json, sys
from qgis.core import QgsApplication, QgsMapRendererSequentialJob, QgsMapSettings, QgsVectorLayer
from qgis.PyQt.QtCore import QSize
from qgis.PyQt.QtGui import QColor
application = QgsApplication([], False)
application.initQgis()
seen = {}
for name in sys.argv[2:]:
    layer = QgsVectorLayer(f"{sys.argv[1]}|layername={name}", name, "ogr")
    legend = [item.label() for item in layer.renderer().legendSymbolItems()]
    settings = QgsMapSettings()
    settings.setLayers([layer])
    settings.setDestinationCrs(layer.crs())
    settings.setExtent(layer.extent())
    settings.setOutputSize(QSize(300, 200))
    settings.setBackgroundColor(QColor("white"))
    job = QgsMapRendererSequentialJob(settings)
    job.start()
    job.waitForFinished()
    picture = job.renderedImage()
    colours = sorted({picture.pixelColor(x, y).name() for x in range(300) for y in range(200)})
    seen[name] = {"valid": layer.isValid(), "count": layer.featureCount(), "legend": legend, "colours": colours}
print(json.dumps(seen))
"""


@pytest.fixture(scope="module")
def qgis() -> None:
    try:
        subprocess.run([PYTHON, "-c", "import qgis.core"], capture_output=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no QGIS: apt-get install python3-qgis qgis-providers")


def test_qgis_opens_a_map_coloured_by_growth(qgis: None, tmp_path: Path) -> None:
    path = grow_row(tmp_path / "orchard.gpkg").path
    looked = subprocess.run(
        [PYTHON, "-c", LOOK, str(path), "fruits", "observations"],
        capture_output=True,
        text=True,
        check=True,
        env={"PATH": "/usr/bin:/bin", "QT_QPA_PLATFORM": "offscreen", "HOME": str(tmp_path)},
    )
    seen = json.loads(looked.stdout)
    assert [seen[name]["valid"] for name in seen] == [True, True]
    assert seen["fruits"]["count"] == len(OrchardMap(path).fruits())
    assert "0.4 to 0.6 mm a day" in seen["fruits"]["legend"]
    assert {"#21918c", "#5ec962"} <= set(seen["fruits"]["colours"]), "fruits of two rates, in their colours"
