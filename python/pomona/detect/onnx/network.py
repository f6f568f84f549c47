"""An ONNX file as ONNX Runtime sees it: what goes in, what comes out, what it says of itself."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pomona.errors import PomonaError
from pomona.reading import require_file
from pomona.recording.picture_size import require_size
from pomona.threads import capped_threads, cores

__all__ = ["SIZES_INPUT", "Network", "Outputs", "input_size", "open_session", "reason_of"]

Outputs = dict[str, NDArray[Any]]
"""The outputs for one picture by name, their axis of the batch taken off."""

SIZES_INPUT = "orig_target_sizes"
"""Second input of RT-DETR and its relatives: (1, 2) int64, the width and height that boxes are scaled to."""

DTYPES = {"tensor(float)": np.float32, "tensor(float16)": np.float16}
NEEDED_INPUT = "one picture (1, 3, height, width) of float32 or float16"


@dataclass(frozen=True, eq=False)
class Network:
    """A session of ONNX Runtime with one picture as its input.

    Attributes
    ----------
    path : Path
        The file.
    metadata : mapping
        What the file says of itself.
    size_px : (int, int) or None
        Width and height of the input, None where any size goes.
    takes_sizes : bool
        Whether there is a second input, `orig_target_sizes`.
    """

    path: Path
    metadata: dict[str, str]
    size_px: tuple[int, int] | None
    takes_sizes: bool
    _session: Any
    _input: str
    _dtype: Any

    @classmethod
    def open(cls, path: Path, threads: int | None = None) -> Network:
        """Load a file.

        Raises
        ------
        PomonaError
            When ONNX Runtime is not installed, the file is no model that it can run, or it wants another input.
        """
        session = open_session(path, threads)
        inputs = {tensor.name: tensor for tensor in session.get_inputs()}
        takes_sizes = inputs.pop(SIZES_INPUT, None) is not None
        picture = next(iter(inputs.values()), None)
        if picture is None or len(inputs) > 1 or not _is_picture(picture):
            found = ", ".join(f"{tensor.name} {tensor.shape} {tensor.type}" for tensor in session.get_inputs())
            raise PomonaError(f"{path}: inputs: found {found}, expected {NEEDED_INPUT}, with or without {SIZES_INPUT}")
        height, width = picture.shape[2:]
        return cls(
            path=path,
            metadata=dict(session.get_modelmeta().custom_metadata_map),
            size_px=input_size(path, width, height),
            takes_sizes=takes_sizes,
            _session=session,
            _input=picture.name,
            _dtype=DTYPES[picture.type],
        )

    def run(self, picture: NDArray[np.float32]) -> Outputs:
        """Run the network on a picture (3, H, W) that was prepared for it.

        Raises
        ------
        PomonaError
            When ONNX Runtime cannot run it.
        """
        fed: dict[str, NDArray[Any]] = {self._input: np.ascontiguousarray(picture[None], self._dtype)}
        if self.takes_sizes:
            fed[SIZES_INPUT] = np.array([picture.shape[:0:-1]], np.int64)
        try:
            outputs = self._session.run(None, fed)
        except Exception as error:  # ONNX Runtime's errors have no base of their own
            raise PomonaError(f"{self.path}: cannot be run: {reason_of(error)}") from None
        names = (tensor.name for tensor in self._session.get_outputs())
        arrays = {name: _of_one_picture(output) for name, output in zip(names, outputs, strict=True)}
        odd = next((name for name, array in arrays.items() if array.dtype.kind not in "fiu"), None)
        if odd is not None:
            raise PomonaError(f"{self.path}: outputs: found {odd} of {arrays[odd].dtype}, expected numbers")
        return arrays


def input_size(path: Path, width: object, height: object) -> tuple[int, int] | None:
    """Width and height of an input, None where any goes.

    Raises
    ------
    PomonaError
        When they are none of a picture's.
    """
    # An axis of any length has a name or None in place of a number, or a number below 0.
    if not isinstance(width, int) or not isinstance(height, int) or min(width, height) < 0:
        return None
    return require_size(f"{path}: input", (width, height))


def open_session(path: Path, threads: int | None = None) -> Any:
    """Give a session of ONNX Runtime.

    Raises
    ------
    PomonaError
        When ONNX Runtime is not installed or the file is no model that it can load.
    """
    try:
        import onnxruntime
    except ImportError:
        needed = "a model needs ONNX Runtime, which is not installed"
        raise PomonaError(f"{path}: {needed}: pip install onnxruntime") from None
    require_file(path, "an ONNX model")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = capped_threads(threads) or cores()
    options.inter_op_num_threads = 1
    options.use_deterministic_compute = True
    options.log_severity_level = 3  # errors only: they come as exceptions too
    # Threads that spin while they wait take the cores from odometry and depth, which run between two pictures.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        session = onnxruntime.InferenceSession(str(path), options, providers=["CPUExecutionProvider"])
        _require_texts(session)
        return session
    except Exception as error:  # ONNX Runtime's errors have no base of their own
        raise PomonaError(f"{path}: not a model that ONNX Runtime can load: {reason_of(error)}") from None


def _require_texts(session: Any) -> None:
    """Read all that the file says of itself: ONNX Runtime decodes it when it is asked for, and fails then."""
    for tensor in (*session.get_inputs(), *session.get_outputs()):
        repr((tensor.name, tensor.shape, tensor.type))
    dict(session.get_modelmeta().custom_metadata_map)


def _is_picture(tensor: Any) -> bool:
    fits = [not isinstance(side, int) or side == wanted for side, wanted in zip(tensor.shape, (1, 3), strict=False)]
    return len(tensor.shape) == 4 and all(fits) and tensor.type in DTYPES


def _of_one_picture(output: Any) -> NDArray[Any]:
    array = np.asarray(output)
    array = array.astype(np.float32) if array.dtype == np.float16 else array
    return array[0] if array.ndim > 1 and array.shape[0] == 1 else array


def reason_of(error: Exception) -> str:
    """Give what ONNX Runtime says, without its code and the path that it repeats."""
    return str(error).strip().split("\n")[0].split(" : ")[-1].split("failed:")[-1][:200]
