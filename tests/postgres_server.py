"""A PostgreSQL server of the tests' own, on a socket and a free port of this machine, gone when they end."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

PROGRAMS = (Path("/usr/lib/postgresql/15/bin"), Path("/usr/lib/postgresql/16/bin"), Path("/usr/lib/postgresql/17/bin"))
USER = "postgres"
PASSWORD = "s3cret-orchard"


@dataclass
class Server:
    """A running server."""

    programs: Path
    data: Path
    port: int

    @property
    def url(self) -> str:
        return self.url_of(USER, PASSWORD)

    def url_of(self, user: str, password: str, name: str = "postgres") -> str:
        return f"postgresql://{user}:{password}@127.0.0.1:{self.port}/{name}"

    def start(self) -> None:
        options = f"-p {self.port} -k {self.data} -c listen_addresses=127.0.0.1 -c fsync=off"
        _as_owner(
            [
                str(self.programs / "pg_ctl"),
                "-D",
                str(self.data),
                "-w",
                "-o",
                options,
                "-l",
                f"{self.data}/log",
                "start",
            ]
        )

    def kill(self) -> None:
        """End it as a power cut does."""
        _as_owner([str(self.programs / "pg_ctl"), "-D", str(self.data), "-m", "immediate", "-w", "stop"])

    def stop(self) -> None:
        subprocess.run(
            _owned([str(self.programs / "pg_ctl"), "-D", str(self.data), "-m", "fast", "stop"]),
            check=False,
            capture_output=True,
        )


def programs() -> Path | None:
    """Where the server's programs are; None where none is installed, or PostGIS is not."""
    for folder in PROGRAMS:
        extensions = Path("/usr/share/postgresql") / folder.parts[-2] / "extension"
        if (folder / "initdb").exists() and (extensions / "postgis.control").exists():
            return folder
    return None


@contextmanager
def running_server() -> Iterator[Server]:
    found = programs()
    assert found is not None
    folder = Path(tempfile.mkdtemp(prefix="pg"))
    try:
        if os.geteuid() == 0:
            shutil.chown(folder, USER, USER)
        secret = folder / "secret"
        secret.write_text(PASSWORD)
        secret.chmod(0o644)
        data = folder / "data"
        _as_owner([str(found / "initdb"), "-D", str(data), "-U", USER, "-A", "scram-sha-256", f"--pwfile={secret}"])
        server = Server(found, data, _free_port())
        server.start()
        try:
            yield server
        finally:
            server.stop()
    finally:
        shutil.rmtree(folder, ignore_errors=True)


def _owned(command: list[str]) -> list[str]:
    """A server does not run as root."""
    return ["runuser", "-u", USER, "--", *command] if os.geteuid() == 0 else command


def _as_owner(command: list[str]) -> None:
    subprocess.run(_owned(command), check=True, capture_output=True, cwd="/")


def _free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as found:
        return int(found.getsockname()[1])
