"""Fruit clouds: CSV and PLY."""

from __future__ import annotations

import struct
import tempfile
from pathlib import Path

import numpy as np

from fuzz.bundle import packed, unpacked
from pomona import FruitCloud

CSV = b"""id,x,y,z,diameter_m,cxx,cyy,czz,cxy,cxz,cyz,n_views,note
a,0.1,0.2,0.3,0.07,1e-4,1e-4,1e-4,0,0,0,5,red
b,1.1,0.2,0.4,,1e-4,1e-4,1e-4,0,0,0,7,"two, words"
c,0.5,-0.2,1.4,0.08,1e-4,2e-4,3e-4,0,1e-5,0,1,
"""

PLY = b"""ply
format ascii 1.0
comment text note 0 "red"
comment text note 1 "gr\\u00fcn"
element vertex 2
property double x
property float y
property float z
property uchar n_views
property int id
element face 1
property list uchar int vertex_indices
end_header
0 1 2 3 4
1.5 2e0 -3 4 5
3 0 1 1
"""


def seeds() -> list[bytes]:
    """One of each kind, and the binary PLY that we write."""
    cloud = FruitCloud(np.eye(3), ids=("a", "b", "c"), diameters_m=np.array([0.07, np.nan, 0.08]), n_views=np.arange(3))
    with tempfile.TemporaryDirectory() as place:
        cloud.write(Path(place) / "cloud.ply")
        written = (Path(place) / "cloud.ply").read_bytes()
    big = (
        written.replace(b"little", b"big").split(b"end_header\n")[0]
        + b"end_header\n"
        + struct.pack(">4di", 1, 2, 3, 4, 5) * 3
    )
    plys = [packed("m", {"cloud.ply": ply}) for ply in (PLY, written, big)]
    return [packed("m", {"cloud.csv": CSV}), packed("free", {"cloud.csv": b"\xef\xbb\xbfx,y,z\r\n1,2,3\r\n"}), *plys]


def target(content: bytes) -> None:
    """Read a cloud."""
    with unpacked(content) as (unit, folder):
        for file in folder.glob("cloud.*"):
            FruitCloud.read(file, unit="mm" if unit == "mm" else "free" if unit == "free" else "m")
