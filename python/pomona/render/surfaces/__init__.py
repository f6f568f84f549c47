"""Meshes of what stands in a row, for renderers that want polygons."""

from pomona.render.surfaces.fruit_mesh import fruit_surface
from pomona.render.surfaces.grass_mesh import grass_surface
from pomona.render.surfaces.leaf_mesh import leaf_surface
from pomona.render.surfaces.limb_mesh import limb_surface
from pomona.render.surfaces.surface import Surface

__all__ = ["Surface", "fruit_surface", "grass_surface", "leaf_surface", "limb_surface"]
