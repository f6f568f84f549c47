"""The executor of many machines: jobs as tasks of a Ray cluster, whose machines see the same results."""

from __future__ import annotations

import contextlib
import os
import secrets
import socket
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from pomona.errors import PomonaError
from pomona.farm.executor import Job, Outcome
from pomona.farm.processes import worker_line

__all__ = ["RayCluster"]

ANSWER_S = 5.0
"""How long a cluster may take to answer at all."""

LONGEST_WAIT_S = 1.0
COUNTING_S = 5.0
"""After so long the machines are counted anew: some may have come or gone."""


class RayCluster:
    """Runs jobs as tasks of a cluster; a task takes one core.

    Steps of one row never overlap, because each needs the one before it: nobody else writes to a row's map.

    Parameters
    ----------
    address : str
        ``host:port`` of the cluster's head, ``auto``, or ``local`` for one of this machine alone.
    results : Path
        Folder that all machines must see under the same name.
    log : callable
        Gives, for a step, the path of its log without a suffix.

    Raises
    ------
    PomonaError
        Ray is not installed, nothing answers there, or a machine does not see `results`.
    """

    def __init__(self, address: str, results: Path, log: Callable[[str], Path]) -> None:
        self.ray = _ray()
        self.log = log
        self.running: dict[Any, tuple[Job, float]] = {}
        _connect(self.ray, address)
        try:
            self._require_shared(results)
        except BaseException:
            self.ray.shutdown()
            raise
        self.counted_s, self.n_cores = -COUNTING_S, 1

    def has_room(self, job: Job) -> bool:
        """Tell whether the cluster has a core more than jobs; which machine has the memory, Ray finds out."""
        del job
        if time.monotonic() - self.counted_s >= COUNTING_S:
            self.n_cores = max(1, int(self.ray.cluster_resources().get("CPU", 1)))
            self.counted_s = time.monotonic()
        return len(self.running) < self.n_cores

    def start(self, job: Job) -> None:
        """Hand a job over."""
        # What is lost is begun anew by the run, which counts how often.
        work = self.ray.remote(num_cpus=1, memory=job.expected_bytes, max_retries=0)(_work)
        self.running[work.remote(worker_line(job, []))] = job, time.monotonic()

    def wait(self) -> list[Outcome]:
        """Wait until a task has ended."""
        if not self.running:
            return []
        ended, _ = self.ray.wait(list(self.running), num_returns=1, timeout=LONGEST_WAIT_S)
        return [self._outcome(task) for task in ended]

    def stop(self) -> None:
        """End what still runs, and leave the cluster."""
        for task in self.running:
            with contextlib.suppress(self.ray.exceptions.RayError):
                self.ray.cancel(task, force=True)
        self.running = {}
        self.ray.shutdown()

    def _outcome(self, task: Any) -> Outcome:
        job, started_s = self.running.pop(task)
        try:
            exit_code, out, err, peak_bytes = self.ray.get(task)
        except self.ray.exceptions.RayError as lost:
            exit_code, out, err, peak_bytes = None, "", f"{type(lost).__name__}\n", 0
        log = self.log(job.step)
        log.with_name(log.name + ".out").write_text(out, encoding="utf-8")
        log.with_name(log.name + ".err").write_text(err, encoding="utf-8")
        return Outcome(job.step, exit_code, out, err, time.monotonic() - started_s, peak_bytes)

    def _require_shared(self, results: Path) -> None:
        """Let every machine look for a file that was just made."""
        marker = results / ".farm" / f"seen-{secrets.token_hex(8)}"
        marker.touch()
        try:
            from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

            nodes = [node for node in self.ray.nodes() if node["Alive"]]
            looks = [
                self.ray.remote(num_cpus=0)(_sees)
                .options(scheduling_strategy=NodeAffinitySchedulingStrategy(node["NodeID"], soft=False))
                .remote(str(marker))
                for node in nodes
            ]
            for node, seen in zip(nodes, self.ray.get(looks), strict=True):
                if not seen:
                    name = node["NodeManagerAddress"]
                    raise PomonaError(f"{results}: the machine {name} does not see it, expected storage that all share")
        finally:
            marker.unlink()


def _ray() -> Any:
    try:
        import ray
    except ImportError:
        raise PomonaError("--ray: Ray is not installed: pip install ray") from None
    return ray


def _connect(ray: Any, address: str) -> None:
    """Join a cluster; one that is not there is told within seconds, which Ray itself would try for much longer."""
    host, colon, port = address.rpartition(":")
    if address not in ("local", "auto"):
        if not (colon and host and port.isdecimal()):
            raise PomonaError(f"--ray: found {address!r}, expected HOST:PORT, auto or local")
        try:
            socket.create_connection((host, int(port)), timeout=ANSWER_S).close()
        except (OSError, OverflowError) as error:
            raise PomonaError(f"--ray: {address}: nothing answers there: {error}") from None
    try:
        ray.init(address=address, log_to_driver=False, configure_logging=False, include_dashboard=False)
    except (ConnectionError, RuntimeError, ValueError) as error:
        raise PomonaError(f"--ray: {address}: {str(error).splitlines()[0]}") from None


def _sees(marker: str) -> bool:
    return os.path.exists(marker)  # noqa: PTH110 # runs where only Ray is sure to be loaded


def _work(line: bytes) -> tuple[int | None, str, str, int]:
    """Run a job in a process of its own on the machine that Ray has chosen; it ends with the task."""
    import resource
    import subprocess
    import sys
    import threading

    # The pipe to it stays open until it has ended, so it is not communicate() that writes the job.
    worker, pipe = [sys.executable, "-m", "pomona.farm.worker"], subprocess.PIPE
    process = subprocess.Popen(worker, stdin=pipe, stdout=pipe, stderr=pipe)
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stderr is not None
    said: dict[str, bytes] = {}
    readers = [
        threading.Thread(target=lambda name=name, stream=stream: said.__setitem__(name, stream.read()))
        for name, stream in (("out", process.stdout), ("err", process.stderr))
    ]
    for reader in readers:
        reader.start()
    process.stdin.write(line)
    process.stdin.flush()
    for reader in readers:
        reader.join()
    code = process.wait()
    process.stdin.close()
    peak_bytes = 1024 * resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    out, err = (said[name].decode("utf-8", "replace") for name in ("out", "err"))
    return (None if code < 0 else code), out, err, peak_bytes
