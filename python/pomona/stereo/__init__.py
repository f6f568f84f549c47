"""Depth out of a rectified pair: at fruits (`StereoDepth`), everywhere (`DenseStereo`), by a network (`OnnxStereo`)."""

from pomona.stereo.dense import DenseStereo
from pomona.stereo.fruit_depth import FruitDepth
from pomona.stereo.fruits import StereoDepth
from pomona.stereo.onnx_stereo import OnnxStereo
from pomona.stereo.opening import open_stereo

__all__ = ["DenseStereo", "FruitDepth", "OnnxStereo", "StereoDepth", "open_stereo"]
