"""Rows of trees out of fruits, pure arrays: which row, which tree, and when no tree can be told."""

from pomona.tree_rows.crowns import Crowns
from pomona.tree_rows.row_lines import RowLine, row_lines
from pomona.tree_rows.tree_spacing import Planting, planting_at, planting_of

__all__ = ["Crowns", "Planting", "RowLine", "planting_at", "planting_of", "row_lines"]
