"""What was seen of each fruit as GeoParquet, a file a date, in folders named as analysts' programs read them.

``FOLDER/row=3/date=2024-08-09/observations.parquet``: DuckDB, Arrow and Spark make columns of ``row`` and ``date``.
"""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from urllib.parse import quote

import numpy as np

from pomona.export import export_cloud
from pomona.orchard import OrchardMap

__all__ = ["FILE", "export_by_date"]

FILE = "observations.parquet"


def export_by_date(orchard: Path, folder: Path) -> int:
    """Write the observations of a map into a folder that may hold those of other maps; return how many there are.

    Parameters
    ----------
    orchard : Path
        The map (.gpkg); its file's name is that of the row.
    folder : Path
        Made where it does not exist. Files of this row whose date the map has no more are removed.

    Raises
    ------
    PomonaError
        It is no map, or cannot be written there.
    """
    cloud = OrchardMap(orchard).observations().cloud()
    dates = np.array(cloud.extras["date"])
    row = folder / f"row={quote(orchard.stem, safe=' ')}"
    written = set()
    for date in sorted(set(dates.tolist())):
        part = cloud.select(dates == date)
        # The folder says it; twice, programs do not know which to take.
        part = replace(part, extras={name: cells for name, cells in part.extras.items() if name != "date"})
        place = row / f"date={quote(date, safe='')}" / FILE
        place.parent.mkdir(parents=True, exist_ok=True)
        export_cloud(part, place, "parquet")
        written.add(place)
    for other in set(row.glob(f"date=*/{FILE}")) - written:
        other.unlink()
        other.parent.rmdir()
    return len(cloud)
