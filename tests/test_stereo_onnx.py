"""Stereo networks: a small real ONNX graph that matches blocks, run by ONNX Runtime."""

import numpy as np
import pytest
from onnx import TensorProto, helper, numpy_helper, save

from depth_scene import box_of
from pomona.errors import PomonaError
from pomona.stereo import OnnxStereo
from pomona.survey.depth import lift
from stereo_scene import PAIR, apple, pair, without_baseline

APPLE = apple(0.0, 0.0, 1.3)
FIRST, COUNT = 18, 30


def block_matcher(path, *, size=None, sign=1.0, inputs=("left", "right"), scale=1.0):
    """Winner takes all over `COUNT` disparities: mean difference of colour in blocks of 9 x 9."""
    height, width = size or ("height", "width")
    initializers, nodes, costs = [], [], []

    def add(kind, *given, **attributes):
        name = f"t{len(nodes)}"
        nodes.append(helper.make_node(kind, given, [name], **attributes))
        return name

    def constant(value):
        name = f"c{len(initializers)}"
        initializers.append(numpy_helper.from_array(np.asarray(value), name))
        return name

    last_axis = constant(np.array([3], np.int64))
    for shift in range(FIRST, FIRST + COUNT):
        padded = add("Pad", "right", constant(np.array([0, 0, 0, shift, 0, 0, 0, 0], np.int64)), mode="edge")
        shifted = add(
            "Slice", padded, constant(np.array([0], np.int64)), constant(np.array([-shift], np.int64)), last_axis
        )
        difference = add("Abs", add("Sub", "left", shifted))
        mean = add("ReduceMean", difference, constant(np.array([1], np.int64)), keepdims=1)
        costs.append(add("AveragePool", mean, kernel_shape=[9, 9], pads=[4, 4, 4, 4]))
    best = add("ArgMin", add("Concat", *costs, axis=1), axis=1, keepdims=1)
    steps = add("Add", add("Cast", best, to=TensorProto.FLOAT), constant(np.float32(FIRST)))
    nodes.append(helper.make_node("Mul", [steps, constant(np.float32(sign * scale))], ["disparity"]))
    value = helper.make_tensor_value_info
    graph = helper.make_graph(
        nodes,
        "block_matcher",
        [value(name, TensorProto.FLOAT, [1, 3, height, width]) for name in inputs],
        [value("disparity", TensorProto.FLOAT, [1, 1, height, width])],
        initializers,
    )
    save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10), str(path))
    return path


@pytest.mark.parametrize(
    "kind",
    [{}, {"sign": -1.0}, {"inputs": ("right", "left")}, {"size": (PAIR.height, PAIR.width)}],
    ids=["any size", "negative", "right first", "its own size"],
)
def test_a_network_measures_the_depth_of_the_whole_picture(tmp_path, kind):
    stereo = OnnxStereo.open(block_matcher(tmp_path / "stereo.onnx", **kind), PAIR)
    left, right, depth_m = pair([APPLE], wall_m=1.8)
    box = box_of(APPLE, PAIR)[None]
    found = stereo(left, right, box)
    inside = np.s_[20:-20, 60:-20]
    assert np.median(np.abs(found.depth_m[inside] / depth_m[inside] - 1)) < 0.03
    lifted = lift(found, box, PAIR)
    assert lifted.centres_in_camera[0, 2] == pytest.approx(1.3, rel=0.04)


def test_a_network_of_half_the_size_gives_disparities_of_the_whole(tmp_path):
    path = block_matcher(tmp_path / "half.onnx", size=(PAIR.height // 2, PAIR.width // 2))
    stereo = OnnxStereo.open(path, PAIR)
    left, right, depth_m = pair([apple(0.0, 0.0, 0.8, 0.12)], wall_m=1.2)
    found = stereo(left, right, np.empty((0, 4)))
    inside = np.s_[20:-20, 80:-20]
    assert np.median(np.abs(found.depth_m[inside] / depth_m[inside] - 1)) < 0.04


def test_what_is_no_stereo_network_is_refused_in_one_line(tmp_path):
    graph = helper.make_graph(
        [helper.make_node("Identity", ["images"], ["out"])],
        "one",
        [helper.make_tensor_value_info("images", TensorProto.FLOAT, [1, 3, 8, 8])],
        [helper.make_tensor_value_info("out", TensorProto.FLOAT, [1, 3, 8, 8])],
    )
    path = tmp_path / "detector.onnx"
    save(helper.make_model(graph, opset_imports=[helper.make_opsetid("", 18)], ir_version=10), str(path))
    with pytest.raises(PomonaError, match=r"inputs: found images .*, expected two pictures"):
        OnnxStereo.open(path, PAIR)
    with pytest.raises(PomonaError, match="not found"):
        OnnxStereo.open(tmp_path / "none.onnx", PAIR)
    with pytest.raises(PomonaError, match="baseline_m"):
        OnnxStereo.open(block_matcher(tmp_path / "stereo.onnx"), without_baseline())
