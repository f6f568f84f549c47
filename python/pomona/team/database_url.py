"""Where the team's database is; the password in it is never shown."""

from __future__ import annotations

import contextlib
import os
import ssl
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any
from urllib.parse import SplitResult, parse_qsl, unquote, urlsplit

from pomona.errors import PomonaError

__all__ = ["Database", "connected", "parsed_url"]

SCHEMES = ("postgresql", "postgres")
PORT = 5432
ANSWER_S = 10
"""How long a server may take to accept a connection."""

REFUSED = "28"
"""Class of PostgreSQL's errors: invalid authorization."""

OPTIONS = ("sslmode", "host")
SSL_MODES = ("disable", "require", "verify-full")


@dataclass(frozen=True)
class Database:
    """A PostgreSQL database.

    Attributes
    ----------
    host, port, name, user : str, int, str, str
        Where it is; a host that begins with a slash is the folder of a socket.
    password : str or None
        Shown nowhere.
    ssl_mode : str
        ``disable``, ``require``, or ``verify-full``, which also looks at the server's certificate.
    """

    host: str
    port: int
    name: str
    user: str
    password: str | None = field(repr=False)
    ssl_mode: str = "disable"

    @property
    def shown(self) -> str:
        """Its address for people."""
        return f"postgresql://{self.user}@{self.host}:{self.port}/{self.name}"


def parsed_url(url: str) -> Database:
    """Read ``postgresql://user@host:5432/name?sslmode=require``; password, user and host also come from PGPASSWORD ...

    Raises
    ------
    PomonaError
        It is none; the line does not repeat it, because a password may stand in it.
    """
    expected = "expected postgresql://USER@HOST:PORT/DATABASE"
    try:
        parts = urlsplit(url)
        port = parts.port or int(os.environ.get("PGPORT", PORT))
    except ValueError:
        raise PomonaError(f"the database's address: has no host and port that can be, {expected}") from None
    if not url.startswith(tuple(f"{scheme}://" for scheme in SCHEMES)) or parts.fragment:
        raise PomonaError(f"the database's address: is none, {expected}")
    name = unquote(parts.path.lstrip("/"))
    if not name:
        raise PomonaError(f"the database's address: names no database, {expected}")
    options = _options(parts.query)
    return Database(
        host=options.get("host") or unquote(parts.hostname or os.environ.get("PGHOST", "localhost")),
        port=port,
        name=name,
        user=unquote(parts.username or os.environ.get("PGUSER", "") or _own_name()),
        password=_password(parts),
        ssl_mode=_ssl_mode(options.get("sslmode", "disable")),
    )


@contextlib.contextmanager
def connected(database: Database) -> Iterator[Any]:
    """Connect, and tell what the server refuses in one line without the password.

    Raises
    ------
    PomonaError
        Nothing answers, the server refuses, or it goes away: then nothing of the transaction is kept.
    """
    try:
        import pg8000.native as pg
    except ImportError:
        raise PomonaError("the team's store needs pg8000: pip install pg8000") from None
    socket = database.host if database.host.startswith("/") else None
    try:
        connection = pg.Connection(
            database.user,
            host=database.host,
            unix_sock=f"{socket}/.s.PGSQL.{database.port}" if socket else None,
            port=database.port,
            database=database.name,
            password=database.password or "",
            ssl_context=_ssl_context(database.ssl_mode),
            timeout=ANSWER_S,
            application_name="pomona",
        )
    except Exception as error:  # whatever a strange server, or a strange password, makes of pg8000
        raise PomonaError(f"{database.shown}: {_line(error, database)}{_hint(error, database)}") from None
    try:
        # Only the connection has a time limit: a large map takes as long as it takes.
        connection._usock.settimeout(None)
        yield connection
    except (pg.DatabaseError, pg.InterfaceError, OSError) as error:
        raise PomonaError(f"{database.shown}: {_line(error, database)}; nothing was written") from None
    finally:
        with contextlib.suppress(pg.InterfaceError, OSError):
            connection.close()


def _password(parts: SplitResult) -> str | None:
    if parts.password is not None:
        return unquote(parts.password)
    return os.environ.get("PGPASSWORD")


def _options(query: str) -> dict[str, str]:
    """Read what stands behind the question mark; a slip there might leave a connection open to all."""
    options: dict[str, str] = {}
    for name, value in parse_qsl(query, keep_blank_values=True):
        if name not in OPTIONS or name in options:
            found = f"{name[:20]!r} twice" if name in options else repr(name[:20])
            raise PomonaError(f"the database's address: found {found} behind the ?, expected {', '.join(OPTIONS)}")
        options[name] = value
    return options


def _hint(error: Exception, database: Database) -> str:
    """Say where the password comes from, when the server wanted one."""
    said = error.args[0] if error.args else None
    wanted = isinstance(said, dict) and str(said.get("C")).startswith(REFUSED)
    return ", expected a password in PGPASSWORD" if wanted and not database.password else ""


def _ssl_mode(mode: str) -> str:
    if mode not in SSL_MODES:
        raise PomonaError(f"the database's address: sslmode: found {mode[:20]!r}, expected {', '.join(SSL_MODES)}")
    return mode


def _ssl_context(mode: str) -> ssl.SSLContext | None:
    if mode == "disable":
        return None
    context = ssl.create_default_context()
    if mode == "require":
        context.check_hostname = False
        context.verify_mode = ssl.CERT_NONE
    return context


def _own_name() -> str:
    import getpass

    return getpass.getuser()


def _line(error: Exception, database: Database) -> str:
    """Say in one line what a server, or the way to it, said."""
    said = error.args[0] if error.args else error
    text = str(said.get("M", said)) if isinstance(said, dict) else str(said)
    text = " ".join(text.split())
    if not isinstance(said, dict) and not isinstance(error, OSError) and " " not in text:
        text = f"what answers there is not understood ({type(error).__name__})"
    if text.startswith("Can't create a connection"):
        text = "nothing answers there"
    return text.replace(database.password, "***") if database.password else text
