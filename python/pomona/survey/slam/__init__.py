"""Where the camera went, from the constellations of the fruits that it saw: links of frames, loops, and their graph."""

from pomona.survey.slam.anchors import Anchors
from pomona.survey.slam.constellation_links import ConstellationLink, Constellations, chained
from pomona.survey.slam.fruit_slam import FruitSlam, PlacedFrame
from pomona.survey.slam.fruit_way import FruitWay, way_by_fruits

__all__ = [
    "Anchors",
    "ConstellationLink",
    "Constellations",
    "FruitSlam",
    "FruitWay",
    "PlacedFrame",
    "chained",
    "way_by_fruits",
]
