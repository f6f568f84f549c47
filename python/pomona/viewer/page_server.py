"""The page on a port of this machine: a few addresses, all for reading, of one map."""

from __future__ import annotations

import contextlib
import json
import socket
import threading
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pomona.errors import PomonaError
from pomona.viewer.built_page import built_page
from pomona.viewer.season_page import Wishes, season_document
from pomona.viewer.token import cookie_name, is_known
from pomona.viewer.told_crops import CropShelf
from pomona.viewer.visitors import why_refused

if TYPE_CHECKING:
    from fastapi import FastAPI, Request, Response

__all__ = ["listening", "page_app", "serve"]

JPEG = b"\xff\xd8\xff"

HEADERS = {
    "Content-Security-Policy": "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data: blob:; "
    "connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cache-Control": "no-store",
}


class _ServedSeason:
    """A map as it is now: told anew when the file has changed."""

    def __init__(self, path: Path, wishes: Wishes) -> None:
        self._path, self._wishes = path, wishes
        self._lock = threading.Lock()
        self._told_of: tuple[int, int] | None = None
        self._now = self._told()

    def text(self) -> bytes:
        return self._told()[0]

    def picture(self, fruit: int, visit: int | None) -> bytes | None:
        return self._told()[1].picture(fruit, visit)

    def _told(self) -> tuple[bytes, CropShelf]:
        with self._lock:
            about = self._path.stat()
            if self._told_of != (about.st_mtime_ns, about.st_size):
                shelf = CropShelf(self._path)
                document = season_document(self._path, self._wishes, shelf.told)
                self._now = json.dumps(document, allow_nan=False).encode(), shelf
                self._told_of = about.st_mtime_ns, about.st_size
            return self._now


def page_app(path: Path, wishes: Wishes, token: str | None = None) -> FastAPI:
    """Make the application that serves one map, to all who know the token where there is one.

    Raises
    ------
    PomonaError
        When the map cannot be told, see `season_document`, or the extra `view` is not installed.
    """
    try:
        from fastapi import FastAPI, Response
    except ImportError:
        raise PomonaError("the live page needs fastapi and uvicorn: pip install fastapi uvicorn") from None
    season, page = _ServedSeason(path, wishes), built_page()
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)

    def season_json() -> Response:
        try:
            return Response(season.text(), media_type="application/json")
        except (PomonaError, OSError) as error:
            said = str(error).replace(str(path), path.name)
            return Response(json.dumps({"error": said}), 503, media_type="application/json")

    kinds = {"/": (page.html, "text/html"), "/page.js": (page.script, "text/javascript")}
    kinds["/page.css"] = (page.style, "text/css")
    for address, (text, kind) in kinds.items():
        app.add_api_route(address, _constant(Response(text, media_type=kind)), methods=["GET", "HEAD"])
    app.add_api_route("/season.json", season_json, methods=["GET", "HEAD"])

    def crop(fruit: int, visit: int | None = None) -> Response:
        picture = season.picture(fruit, visit)
        if picture is None:
            return Response("no such picture", 404, media_type="text/plain")
        return Response(picture, media_type="image/jpeg" if picture.startswith(JPEG) else "image/webp")

    for address in ("/crops/{fruit}", "/crops/{fruit}/{visit}"):
        app.add_api_route(address, crop, methods=["GET", "HEAD"])
    app.middleware("http")(_guard(token))
    return app


def _constant(response: Response) -> Callable[[], Response]:
    return lambda: response


def _guard(token: str | None) -> Callable[[Request, Callable[[Request], Awaitable[Response]]], Awaitable[Response]]:
    from fastapi import Response

    async def guarded(request: Request, answer: Callable[[Request], Awaitable[Response]]) -> Response:
        refused = why_refused(request.headers)
        told = request.query_params.get("token")
        if refused is None and token is not None and not is_known(token, told, request.cookies):
            refused = "token: expected the one in the address that `pomona view` has printed"
        if refused is not None:
            response = Response(refused, 403, media_type="text/plain")
        elif token is not None and told is not None:
            response = _let_in(token, request.url.path)
        else:
            response = await answer(request)
        response.headers.update(HEADERS)
        return response

    return guarded


def _let_in(token: str, path: str) -> Response:
    """Keep the token in the browser, and take it out of the address, which people pass on and photograph."""
    from fastapi import Response

    # An address with two slashes in front would lead to another machine.
    response = Response(status_code=303, headers={"Location": f"/{path.lstrip('/')}"})
    response.set_cookie(cookie_name(token), token, httponly=True, samesite="lax")
    return response


def listening(host: str, port: int) -> socket.socket:
    """Take a port, any free one for 0, so that whoever is told of it can ask at once.

    Raises
    ------
    PomonaError
        When it is taken, or the address is none of this machine's.
    """
    with contextlib.ExitStack() as undone:
        try:
            family, kind, _, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
            taken = undone.enter_context(socket.socket(family, kind))
            taken.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            taken.bind(address)
            taken.listen()
        except OSError as error:
            raise PomonaError(f"--host {host} --port {port}: cannot be listened on: {error.strerror}") from None
        undone.pop_all()
        return taken


def serve(app: Any, taken: socket.socket) -> None:
    """Answer until Ctrl-C."""
    import uvicorn

    uvicorn.Server(uvicorn.Config(app, log_config=None, log_level="error", server_header=False)).run(sockets=[taken])
