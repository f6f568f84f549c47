"""QGIS itself, as Debian ships it: opens layers and draws them."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path
from typing import Any

import pytest

PYTHON = "/usr/bin/python3"
"""The interpreter that Debian's QGIS is built for."""

LOOK = """
import json, sys
from qgis.core import QgsApplication, QgsMapRendererSequentialJob, QgsMapSettings, QgsVectorLayer
from qgis.PyQt.QtCore import QSize
from qgis.PyQt.QtGui import QColor
application = QgsApplication([], False)
application.initQgis()
seen = []
for source in sys.argv[2:]:
    layer = QgsVectorLayer(source, "seen", sys.argv[1])
    legend = [item.label() for item in layer.renderer().legendSymbolItems()] if layer.isValid() else []
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
    fields = [field.name() for field in layer.fields()]
    count = layer.featureCount()
    seen.append({"valid": layer.isValid(), "count": count, "legend": legend, "colours": colours, "fields": fields})
print(json.dumps(seen))
"""


def require_qgis() -> None:
    """Skip the test where QGIS is not installed."""
    try:
        subprocess.run([PYTHON, "-c", "import qgis.core"], capture_output=True, check=True)
    except (OSError, subprocess.CalledProcessError):
        pytest.skip("no QGIS: apt-get install python3-qgis qgis-providers")


def seen_by_qgis(provider: str, *sources: str, home: Path) -> list[dict[str, Any]]:
    """Open layers, draw each, and tell what was there."""
    looked = subprocess.run(
        [PYTHON, "-c", LOOK, provider, *sources],
        capture_output=True,
        text=True,
        check=True,
        env={"PATH": "/usr/bin:/bin", "QT_QPA_PLATFORM": "offscreen", "HOME": str(home)},
    )
    seen: list[dict[str, Any]] = json.loads(looked.stdout.splitlines()[-1])
    return seen
