"""Small real detectors as ONNX graphs: they find the red rectangle of a picture, and say so as a family of models does.

They look at what they are given, so a wrong order of channels, scale or place in the input gives a wrong box or none.
"""

import json
from pathlib import Path

import numpy as np
from onnx import TensorProto, helper, numpy_helper

IMAGENET_RED = (0.5 - 0.485) / 0.229
ANCHOR = 5
"""The row of a dense head that holds the box."""


class Graph:
    """Nodes under construction; `add` gives the name of what a node makes."""

    def __init__(self, width, height, *, sizes=False, half=False, dynamic=False):
        side = ["height", "width"] if dynamic else [height, width]
        kind = TensorProto.FLOAT16 if half else TensorProto.FLOAT
        self.inputs = [helper.make_tensor_value_info("images", kind, [1, 3, *side])]
        if sizes:
            self.inputs.append(helper.make_tensor_value_info("orig_target_sizes", TensorProto.INT64, [1, 2]))
        self.nodes, self.initializers = [], []
        self.images = self.add("Cast", "images", to=TensorProto.FLOAT)

    def add(self, kind, *inputs, **attributes):
        name = f"t{len(self.nodes)}"
        given = [value if isinstance(value, str) else self.constant(value) for value in inputs]
        self.nodes.append(helper.make_node(kind, given, [name], **attributes))
        return name

    def constant(self, value):
        name = f"c{len(self.initializers)}"
        array = np.asarray(value)
        array = array.astype(np.float32) if array.dtype == np.float64 else array
        self.initializers.append(numpy_helper.from_array(array, name))
        return name

    def row(self, *values):
        """Numbers and tensors of one number as one row (1, F)."""
        parts = [value if isinstance(value, str) else self.constant([float(value)]) for value in values]
        return self.add("Unsqueeze", self.add("Concat", *parts, axis=0), [0])

    def write(self, path, outputs, metadata=None, kinds=None):
        made = [
            helper.make_tensor_value_info(name, (kinds or {}).get(name, TensorProto.FLOAT), None) for name in outputs
        ]
        nodes = [*self.nodes, *(helper.make_node("Identity", [made], [name]) for name, made in outputs.items())]
        graph = helper.make_graph(nodes, "detector", self.inputs, made, self.initializers)
        model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 17)], ir_version=8)
        for key, value in (metadata or {}).items():
            model.metadata_props.add(key=key, value=value if isinstance(value, str) else json.dumps(value))
        Path(path).write_bytes(model.SerializeToString())
        return path


def find_red(graph, *, channel=0, above=0.5):
    """Corners x0, y0, x1, y1 of what is red, in pixels of the input; 1 if there is any; and where it is."""
    plane = graph.add("Gather", graph.images, np.array([channel]), axis=1)
    hits = graph.add("Cast", graph.add("Greater", plane, np.float32(above)), to=TensorProto.FLOAT)
    ends = {}
    for name, across in (("x", 2), ("y", 3)):
        seen = graph.add("ReduceMax", hits, axes=[0, 1, across], keepdims=0)
        ends.update(_ends(graph, seen, name))
    return [ends[name] for name in ("x0", "y0", "x1", "y1")], ends["seen"], hits


def _ends(graph, seen, name):
    count = graph.add("Squeeze", graph.add("Shape", seen))
    places = graph.add("Cast", graph.add("Range", np.int64(0), count, np.int64(1)), to=TensorProto.FLOAT)
    length = graph.add("Cast", count, to=TensorProto.FLOAT)
    high = graph.add("ReduceMax", graph.add("Mul", seen, graph.add("Add", places, np.float32(1))), axes=[0])
    left = graph.add("ReduceMax", graph.add("Mul", seen, graph.add("Sub", length, places)), axes=[0])
    low = graph.add("Sub", length, left)
    return {f"{name}0": low, f"{name}1": high, "seen": graph.add("ReduceMax", seen, axes=[0])}


def centred(graph, corners):
    """Centre and size of corners; a size of nothing is a little more, as a network's is."""
    x0, y0, x1, y1 = corners
    middles = [graph.add("Mul", graph.add("Add", low, high), np.float32(0.5)) for low, high in ((x0, x1), (y0, y1))]
    sizes = [graph.add("Max", graph.add("Sub", high, low), np.float32(1e-3)) for low, high in ((x0, x1), (y0, y1))]
    return [*middles, *sizes]


def scaled(graph, tensors, by):
    return [graph.add("Mul", tensor, np.float32(factor)) for tensor, factor in zip(tensors, by, strict=True)]


def among(graph, rows, count, filler=None):
    """Rows (each (1, F)) from ANCHOR on among `count` rows of zeros or `filler` (count, F), as (1, count, F)."""
    width = next(width for width in [_width(graph, rows[0])] if width)
    rest = np.zeros((count, width), np.float32) if filler is None else filler.astype(np.float32)
    parts = [graph.constant(rest[:ANCHOR]), *rows, graph.constant(rest[ANCHOR + len(rows) :])]
    return graph.add("Unsqueeze", graph.add("Concat", *parts, axis=0), [0])


def _width(graph, row):
    """Count what `row` put together."""
    unsqueeze = next(node for node in graph.nodes if node.output[0] == row)
    return len(next(node for node in graph.nodes if node.output[0] == unsqueeze.input[0]).input)


def cells(width, height, strides=(8, 16, 32)):
    return sum((width // stride) * (height // stride) for stride in strides)


def with_mask(graph, corners, hits):
    """Corners drawn too large, the coefficients of a mask that says better, and the output of its prototypes."""
    loose = [graph.add("Add", corner, np.float32(by)) for corner, by in zip(corners, (-6, -7, 9, 5), strict=True)]
    shapes = graph.add("AveragePool", hits, kernel_shape=[4, 4], strides=[4, 4])
    first = graph.add("Sub", shapes, np.float32(0.5))
    others = graph.add("Concat", *[graph.add("Add", first, np.float32(7))] * 31, axis=1)
    return loose, [20.0] + [0.0] * 31, {"output1": graph.add("Concat", first, others, axis=1)}


def yolov8(path, width, height, *, classes=2, double=False, metadata=None, masks=False, **options):
    graph = Graph(width, height, **options)
    corners, seen, hits = find_red(graph)
    corners, coefficients, shapes = with_mask(graph, corners, hits) if masks else (corners, [], {})
    box, strong, weak = centred(graph, corners), *scaled(graph, [seen, seen], (0.9, 0.6))
    rows = [graph.row(*box, strong, *[0.01] * (classes - 1), *coefficients)]
    if double:
        moved = [graph.add("Add", box[0], np.float32(1)), *box[1:]]
        rows.append(graph.row(*moved, 0.01, weak, *[0.01] * (classes - 2)))
    head = graph.add("Transpose", among(graph, rows, cells(width, height)), perm=[0, 2, 1])
    return graph.write(path, {"output0": head, **shapes}, metadata)


def yolov5(path, width, height, *, classes=1, metadata=None, masks=False, **options):
    graph = Graph(width, height, **options)
    corners, seen, hits = find_red(graph)
    corners, coefficients, shapes = with_mask(graph, corners, hits) if masks else (corners, [], {})
    row = graph.row(*centred(graph, corners), *scaled(graph, [seen], (0.9,)), *[0.8] * classes, *coefficients)
    return graph.write(path, {"output0": among(graph, [row], 3 * cells(width, height)), **shapes}, metadata)


def end_to_end(path, width, height, *, metadata=None, masks=False, **options):
    graph = Graph(width, height, **options)
    corners, seen, hits = find_red(graph)
    corners, coefficients, shapes = with_mask(graph, corners, hits) if masks else (corners, [], {})
    row = graph.row(*corners, *scaled(graph, [seen], (0.9,)), 0, *coefficients)
    return graph.write(path, {"output0": among(graph, [row], 300), **shapes}, metadata)


def yolox(path, width, height, *, decoded=False, metadata=None):
    graph = Graph(width, height)
    corners, seen, _ = find_red(graph, channel=2, above=127.5)
    box = centred(graph, corners)
    grids = [np.mgrid[: height // s, : width // s][::-1].reshape(2, -1).T for s in (8, 16, 32)]
    strides = np.concatenate([np.full((len(cell), 1), s) for cell, s in zip(grids, (8, 16, 32), strict=True)])
    corner = np.concatenate(grids)
    rest = np.hstack([(corner + 0.5) * strides, strides, strides, np.zeros((len(corner), 2))])
    if not decoded:
        stride = float(strides[ANCHOR, 0])
        cell = [
            graph.add("Sub", tensor, np.float32(at))
            for tensor, at in zip(scaled(graph, box[:2], (1 / stride, 1 / stride)), corner[ANCHOR], strict=True)
        ]
        box = [*cell, *(graph.add("Log", tensor) for tensor in scaled(graph, box[2:], (1 / stride, 1 / stride)))]
        rest = np.hstack([np.full((len(corner), 2), 0.5), np.zeros((len(corner), 4))])
    row = graph.row(*box, *scaled(graph, [seen], (0.9,)), 0.8)
    return graph.write(path, {"output": among(graph, [row], len(corner), rest)}, metadata)


def rtdetr(path, width, height, **options):
    graph = Graph(width, height, sizes=True, **options)
    corners, seen, _ = find_red(graph)
    parts = graph.row(*scaled(graph, corners, (1 / width, 1 / height) * 2))
    sizes = graph.add("Cast", "orig_target_sizes", to=TensorProto.FLOAT)
    box = graph.add("Mul", parts, graph.add("Concat", sizes, sizes, axis=1))
    rest = [graph.constant(np.zeros((n, 4), np.float32)) for n in (ANCHOR, 294)]
    boxes = graph.add("Unsqueeze", graph.add("Concat", rest[0], box, rest[1], axis=0), [0])
    scores = graph.add("Squeeze", among(graph, [graph.row(*scaled(graph, [seen], (0.9,)))], 300), [2])
    labels = graph.constant(np.full((1, 300), 3, np.int64))
    outputs = {"labels": labels, "boxes": boxes, "scores": scores}
    return graph.write(path, outputs, kinds={"labels": TensorProto.INT64})


def rtdetr_ultralytics(path, width, height, *, metadata):
    graph = Graph(width, height)
    corners, seen, _ = find_red(graph)
    box = scaled(graph, centred(graph, corners), (1 / width, 1 / height) * 2)
    row = graph.row(*box, *scaled(graph, [seen], (0.9,)), 0.01)
    return graph.write(path, {"output0": among(graph, [row], 300)}, metadata)


def rfdetr(path, width, height, *, masks=None, metadata=None):
    """RF-DETR of three classes, whose boxes and logits have the same shape; no thing has the highest logit."""
    graph = Graph(width, height)
    corners, seen, hits = find_red(graph, above=IMAGENET_RED)
    if masks:
        corners = [graph.add("Add", corner, np.float32(by)) for corner, by in zip(corners, (-6, -7, 9, 5), strict=True)]
    box = graph.row(*scaled(graph, centred(graph, corners), (1 / width, 1 / height) * 2))
    logit = graph.add("Sub", scaled(graph, [seen], (12.0,))[0], np.float32(10))
    rest = np.full((300, 4), -10.0)
    rest[0, 3] = 5.0
    outputs = {
        "dets": among(graph, [box], 300, np.full((300, 4), 0.25)),
        "labels": among(graph, [graph.row(-10, logit, -10, -10)], 300, rest),
    }
    if masks:
        shapes = graph.add("AveragePool", hits, kernel_shape=[4, 4], strides=[4, 4])
        own = graph.add("Sub", graph.add("Mul", shapes, np.float32(20)), np.float32(10))
        nothing = [graph.constant(np.full((1, n, height // 4, width // 4), -10, np.float32)) for n in (ANCHOR, 294)]
        outputs[masks] = graph.add("Concat", nothing[0], own, nothing[1], axis=1)
    return graph.write(path, outputs, metadata)


def grey_levels(path, width, height, levels):
    """A head that has chosen: for each grey level the box of all that has it, class its number."""
    graph = Graph(width, height)
    plane = graph.add("Gather", graph.images, np.array([0]), axis=1)
    distance = graph.add("Abs", graph.add("Sub", plane, (np.asarray(levels) / 255).reshape(1, -1, 1, 1)))
    hits = graph.add("Cast", graph.add("Less", distance, np.float32(3 / 255)), to=TensorProto.FLOAT)
    ends = {}
    for name, axis, length in (("x", 2, width), ("y", 3, height)):
        seen = graph.add("ReduceMax", hits, axes=[axis], keepdims=0)
        places = np.arange(length, dtype=np.float32)
        ends[f"{name}1"] = graph.add("ReduceMax", graph.add("Mul", seen, places + 1), axes=[2])
        left = graph.add("ReduceMax", graph.add("Mul", seen, length - places), axes=[2])
        ends[f"{name}0"] = graph.add("Sub", np.float32(length), left)
        ends["seen"] = graph.add("Mul", graph.add("ReduceMax", seen, axes=[2]), np.float32(0.9))
    classes = graph.constant(np.arange(len(levels), dtype=np.float32).reshape(1, -1, 1))
    head = graph.add("Concat", *(ends[name] for name in ("x0", "y0", "x1", "y1", "seen")), classes, axis=2)
    return graph.write(path, {"output0": head})
