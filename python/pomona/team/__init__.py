"""The team's store: orchard maps in PostGIS, as whole as in their files, with every version of every row."""

from pomona.team.pulling import pull_map
from pomona.team.pushing import Pushed, push_map

__all__ = ["Pushed", "pull_map", "push_map"]
