"""Meshes of what stands in a row, for renderers that want polygons."""

from pomona.render.surfaces.fruits import fruit_surface
from pomona.render.surfaces.grass import grass_surface
from pomona.render.surfaces.leaves import leaf_surface
from pomona.render.surfaces.limbs import limb_surface
from pomona.render.surfaces.surface import Surface

__all__ = ["Surface", "fruit_surface", "grass_surface", "leaf_surface", "limb_surface"]
