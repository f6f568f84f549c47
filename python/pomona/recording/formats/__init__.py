"""Recordings as files of a kind: one module for each layout or container, opened by `recording/opening.py`."""
