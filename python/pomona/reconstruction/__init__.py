"""Reconstructions of other programs, read and written by ourselves: COLMAP models, text and binary, old and new."""

from pomona.reconstruction.opening import open_reconstruction
from pomona.reconstruction.sparse_model import SparseModel
from pomona.reconstruction.writing_models import write_reconstruction

__all__ = ["SparseModel", "open_reconstruction", "write_reconstruction"]
