"""The network as an ONNX graph, and its numbers back out of one."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import torch
from numpy.typing import NDArray
from onnx import TensorProto, helper, numpy_helper

from pomona.atomic import whole_file
from pomona.detect.onnx.claims import OWN_KEY
from pomona.detect.onnx.families import FRUITS
from pomona.detect.training.fruit_network import WIDTHS, FruitNetwork
from pomona.errors import PomonaError
from pomona.likes import MODEL_MARK

__all__ = ["LAST", "network_in", "write_network"]

OPSET = 17
LAST = "map"
"""Name of the last convolution."""

HALF = ".half"
"""Ends the names of numbers that are kept in 16 bits."""

STEM = "stem.0.0.weight"
"""The first convolution, whose channels tell how wide a network is."""

WIDEST = 4
"""Times the channels of the network that ships, of a teacher that is read."""

QUANTIZED = "_quantized"
"""Ends the names that ONNX Runtime gives to numbers in 8 bits, or 32 for biases; `_scale` those of what they are in."""


def write_network(
    path: Path,
    network: FruitNetwork,
    min_score: float,
    about: Mapping[str, Any],
    *,
    halved: bool = False,
    usual_px: float | None = None,
) -> None:
    """Write a network without normalisations.

    Parameters
    ----------
    path : Path
        The ONNX file.
    network : FruitNetwork
        As `folded` gives it.
    min_score : float
        Least score that a detector with it takes.
    about : mapping
        What it was trained on, JSON values.
    halved : bool
        Whether the file holds its numbers in 16 bits; it calculates in 32 bits all the same.
    usual_px : float, optional
        Side of the fruits that it has learnt from, where it is another than the shipped network's.
    """
    graph = _Graph({name: weights.detach().numpy() for name, weights in network.state_dict().items()}, halved)
    graph.network()
    sides = ["height", "width"]
    made = helper.make_graph(
        graph.nodes,
        "fruits",
        [helper.make_tensor_value_info("pictures", TensorProto.FLOAT, [1, 3, *sides])],
        [helper.make_tensor_value_info(FRUITS, TensorProto.FLOAT, [1, 6, "rows", "columns"])],
        graph.initializers,
    )
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", OPSET)], ir_version=8)
    own = {"version": 1, "family": "pomona", "names": ["fruit"], "min_score": round(min_score, 4)}
    own |= {} if usual_px is None else {"usual_px": round(usual_px, 1)}
    model.metadata_props.add(key=OWN_KEY, value=json.dumps(own))
    model.metadata_props.add(key=MODEL_MARK.decode(), value=json.dumps(about))
    onnx.checker.check_model(model)
    with whole_file(path) as partial:
        partial.write_bytes(model.SerializeToString())


def network_in(path: Path) -> FruitNetwork:
    """Read the network out of a file that `write_network` wrote, or `write_eight_bits` out of that.

    Eight bits are read as the numbers that they stand for; a teacher may be up to `WIDEST` times as wide.

    Raises
    ------
    PomonaError
        It holds another one.
    """
    try:
        found = {name: torch.from_numpy(array) for name, array in _numbers_in(onnx.load(path).graph)}
    except Exception as error:  # protobuf's errors have no base of their own, and a stranger's numbers any shape
        raise PomonaError(f"{path}: not an ONNX model ({' '.join(str(error).split())[:100]})") from None
    # Only these widths are made: a network as wide as a stranger's file says might fill the memory.
    stems = {tuple(found[STEM].shape)} if STEM in found else set()
    wide = next((wider for wider in range(2, WIDEST + 1) if (wider * WIDTHS[0], 3, 3, 3) in stems), 1)
    network = FruitNetwork(normalised=False, wider=wide)
    wanted = network.state_dict()
    if any(name not in found or found[name].shape != weights.shape for name, weights in wanted.items()):
        raise PomonaError(f"{path}: found another network, expected the shipped one or one that was trained from it")
    network.load_state_dict({name: found[name] for name in wanted})
    return network


def _numbers_in(graph: onnx.GraphProto) -> Iterator[tuple[str, NDArray[np.float32]]]:
    """Give names and numbers, those in eight bits times their scales, one for each channel that is made."""
    arrays = {each.name: np.array(numpy_helper.to_array(each)) for each in graph.initializer}
    for name, array in arrays.items():
        if name.endswith(QUANTIZED):
            named = name.removesuffix(QUANTIZED)
            scales = arrays.get(f"{named}{QUANTIZED}_scale", arrays.get(f"{named}_scale"))
            scales = np.ones(1) if scales is None else scales
            yield named, (array * scales.reshape(-1, *[1] * (array.ndim - 1))).astype(np.float32)
        else:
            yield name.removesuffix(HALF), array


class _Graph:
    """Nodes of the network, under the names of its parts."""

    def __init__(self, weights: dict[str, Any], halved: bool) -> None:
        self.weights = weights
        self.nodes: list[onnx.NodeProto] = []
        self.initializers: list[onnx.TensorProto] = []
        for name, array in weights.items():
            if halved:
                self.initializers.append(numpy_helper.from_array(array.astype(np.float16), name + HALF))
                self.node("Cast", [name + HALF], name, to=TensorProto.FLOAT)
            else:
                self.initializers.append(numpy_helper.from_array(array, name))
        self.initializers.append(numpy_helper.from_array(np.array([1, 1, 2, 2], np.float32), "doubled"))

    def network(self) -> None:
        quarter = self.part("stem", "pictures")
        eighth = self.part("eighth", quarter)
        sixteenth = self.part("sixteenth", eighth)
        sixteenth = self.joined("to_sixteenth", self.part("thirtysecond", sixteenth), sixteenth)
        sixteenth = self.block("at_sixteenth", sixteenth)
        eighth = self.joined("to_eighth", sixteenth, eighth)
        quarter = self.joined("to_quarter", self.block("at_eighth", eighth), quarter)
        self.convolution(LAST, self.block("at_quarter", quarter), FRUITS)

    def part(self, name: str, given: str) -> str:
        for row, stride in self.strides(name):
            given = self.block(f"{name}.{row}", given, stride)
        return given

    def strides(self, name: str) -> Iterator[tuple[int, int]]:
        rows = [row for row in range(9) if f"{name}.{row}.0.weight" in self.weights]
        halved = 2 if name == "stem" else 1
        yield from ((row, 2 if row < halved else 1) for row in rows)

    def block(self, name: str, given: str, stride: int = 1) -> str:
        return self.node("Relu", [self.convolution(f"{name}.0", given, f"{name}.made", stride)], f"{name}.out")

    def joined(self, name: str, coarse: str, fine: str) -> str:
        given = self.convolution(name, coarse, f"{name}.made")
        steps = {"mode": "nearest", "coordinate_transformation_mode": "asymmetric", "nearest_mode": "floor"}
        larger = self.node("Resize", [given, "", "doubled"], f"{name}.larger", **steps)
        return self.node("Add", [fine, larger], f"{name}.joined")

    def convolution(self, name: str, given: str, made: str, stride: int = 1) -> str:
        side = self.weights[f"{name}.weight"].shape[2]
        sizes = {"kernel_shape": [side, side], "strides": [stride, stride], "pads": [side // 2] * 4}
        return self.node("Conv", [given, f"{name}.weight", f"{name}.bias"], made, name=name, **sizes)

    def node(self, kind: str, given: list[str], made: str, name: str = "", **attributes: Any) -> str:
        self.nodes.append(helper.make_node(kind, given, [made], name=name or made, **attributes))
        return made
