"""The live page: what it serves, to whom, and that it leaves the map alone."""

import hashlib
import http.client
import ipaddress
import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from datetime import date
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import urlopen

import numpy as np
import pytest

from command_line import Pomona
from growth_maker import grow_row
from page_maker import served
from pomona import FruitCloud, PomonaError
from pomona.fruit_crop import FruitCrop
from pomona.orchard import OrchardMap, Session, add_session
from pomona.viewer.own_address import own_address
from pomona.viewer.page_server import listening
from test_crops import webp


@pytest.fixture(scope="module")
def orchard(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return grow_row(tmp_path_factory.mktemp("row") / "orchard.gpkg", (50, 65), n_trees=2).path


@pytest.fixture(scope="module")
def address(orchard: Path) -> Iterator[str]:
    with served(orchard) as url:
        yield url


def ask(address: str, path: str, method: str = "GET", **headers: str) -> tuple[int, dict[str, str], bytes]:
    """A request just as it is written: nobody tidies its path or its headers."""
    there = urlsplit(address)
    connection = http.client.HTTPConnection(there.hostname, there.port, timeout=60)
    try:
        connection.putrequest(method, path, skip_host="Host" in headers)
        for name, value in headers.items():
            connection.putheader(name.replace("_", "-"), value)
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, dict(answer.getheaders()), answer.read()
    finally:
        connection.close()


def test_the_page_and_its_season_are_served(address: str, orchard: Path) -> None:
    for path, begins in (("/", b"<!doctype html>"), ("/page.js", b""), ("/page.css", b"")):
        status, headers, body = ask(address, path)
        assert (status, body.startswith(begins)) == (200, True)
        assert "default-src 'none'" in headers["content-security-policy"]
        assert headers["x-content-type-options"] == "nosniff"
    with urlopen(f"{address}season.json", timeout=60) as answer:
        assert json.load(answer)["name"] == orchard.name


def test_nothing_else_is_served(address: str, orchard: Path) -> None:
    outside = (
        "/orchard.gpkg",
        f"/{orchard}",
        "/../orchard.gpkg",
        "/..%2f..%2fetc%2fpasswd",
        "/page/../../pyproject.toml",
    )
    for path in (*outside, "/docs", "/openapi.json", "/built_from.json", "/crops/1", "/crops/..%2f1/0", "/crops/-1/9"):
        status, _, body = ask(address, path)
        assert status in (404, 422), path
        assert b"SQLite" not in body
    for method in ("POST", "PUT", "DELETE"):
        assert ask(address, "/season.json", method)[0] == 405


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({}, 200),
        ({"Host": "localhost:1"}, 200),
        ({"Host": "[::1]:1"}, 200),
        ({"Host": "orchard.example"}, 403),
        ({"Host": "127.0.0.1.example:80"}, 403),
        ({"Host": "[::1"}, 403),
        ({"Host": ""}, 403),
        ({"Origin": "http://evil.example"}, 403),
        ({"Origin": "null"}, 403),
        ({"Sec_Fetch_Site": "cross-site"}, 403),
        ({"Sec_Fetch_Site": "same-site", "Sec_Fetch_Dest": "image"}, 403),
        ({"Sec_Fetch_Site": "cross-site", "Sec_Fetch_Dest": "document"}, 200),
        ({"Sec_Fetch_Site": "same-origin"}, 200),
    ],
)
def test_only_this_page_may_ask(address: str, headers: dict[str, str], status: int) -> None:
    found, _, body = ask(address, "/season.json", **headers)
    assert found == status
    assert status == 200 or b"visits" not in body


def test_an_own_origin_may_ask(address: str) -> None:
    host = urlsplit(address).netloc
    assert ask(address, "/season.json", Host=host, Origin=f"http://{host}")[0] == 200


def test_the_map_stays_as_it_is(address: str, orchard: Path) -> None:
    before = hashlib.sha256(orchard.read_bytes()).hexdigest()
    ask(address, "/season.json")
    assert hashlib.sha256(orchard.read_bytes()).hexdigest() == before
    assert list(orchard.parent.iterdir()) == [orchard]


def test_others_cannot_reach_it(address: str) -> None:
    port = urlsplit(address).port
    with socket.socket() as other:
        other.settimeout(5)
        assert other.connect_ex(("127.0.0.2", port)) != 0, "it listens on 127.0.0.1 alone"


def let_in(url: str) -> tuple[str, str]:
    """Follow the address that was printed as a browser does; return where it leads and the cookie."""
    there = urlsplit(url)
    status, headers, body = ask(url, f"/?{there.query}")
    assert (status, body) == (303, b"")
    assert {"HttpOnly", "SameSite=lax"} <= set(headers["set-cookie"].split("; "))
    return headers["location"], headers["set-cookie"].partition(";")[0]


def test_other_machines_need_the_token(orchard: Path) -> None:
    with served(orchard, "--host", "0.0.0.0") as url:
        assert urlsplit(url).query.startswith("token=")
        assert urlsplit(url).hostname != "0.0.0.0", "another machine cannot open that"
        where, cookie = let_in(url)
        assert where == "/"
        for path in ("/", "/page.js", "/page.css", "/season.json"):
            assert ask(url, path, Cookie=cookie)[0] == 200
            for status, _, body in (
                ask(url, path),
                ask(url, f"{path}?token="),
                ask(url, f"{path}?token=%ff%fe", Cookie=cookie),
                ask(url, path, Cookie=f"{cookie}x"),
            ):
                assert (status, body[:6]) == (403, b"token:")
        # A name that somebody points to this machine does not help who knows the token.
        assert ask(url, "/season.json", Cookie=cookie, Host="orchard.example")[0] == 403
        assert ask(url, f"//evil.example/?{urlsplit(url).query}")[1]["location"] == "/evil.example/"


@pytest.mark.parametrize("host", ["127.0.0.1", "0.0.0.0", "::1", "::"])
def test_what_listens_can_be_asked_where_it_says(host: str) -> None:
    try:
        taken = listening(host, 0)
    except PomonaError as error:
        pytest.skip(f"no such address here: {error}")
    with taken:
        address = own_address(taken)
        assert host in ("0.0.0.0", "::") or address == host
        assert not ipaddress.ip_address(address).is_unspecified
        with socket.create_connection((address, taken.getsockname()[1]), timeout=20) as asked:
            assert asked.getpeername()[0] == address


def test_without_a_way_to_others_it_is_this_machine_s_own_address(monkeypatch: pytest.MonkeyPatch) -> None:
    def unreachable(*_: object) -> None:
        raise OSError("Network is unreachable")

    monkeypatch.setattr(socket.socket, "connect", unreachable)
    with listening("0.0.0.0", 0) as taken:
        assert own_address(taken) == "127.0.0.1"


def test_a_token_of_one_s_own(pomona: Pomona, orchard: Path) -> None:
    wanted = "my-own-token_2024-08"
    with served(orchard, "--token", wanted) as url:
        assert urlsplit(url).query == f"token={wanted}"
        assert ask(url, "/season.json")[0] == 403
        assert ask(url, "/season.json", Cookie=let_in(url)[1])[0] == 200
    for wrong in ("short", "a token with spaces in it", ""):
        code, _, told = pomona("view", orchard, "--port", 0, "--token", wrong)
        assert code == 2
        assert told == (
            f"pomona: --token: found {len(wrong)} characters, expected 16 to 200 of a letter, a digit, '-' or '_'\n"
        )


def test_pictures_are_served_and_a_new_visit_is_told(tmp_path: Path) -> None:
    path = grow_row(tmp_path / "orchard.gpkg", (50,), n_trees=1).path
    with served(path) as address:
        told = json.loads(ask(address, "/season.json")[2])
        assert (len(told["visits"]), told["crops"]) == (1, None)
        add_with_crop(path)
        told = json.loads(ask(address, "/season.json")[2])
        assert len(told["visits"]) == 2
        assert told["crops"]["best"]["n"] == 1
        assert told["crops"]["pictures"] is None
        fruit = next(one for one in range(1, 200) if ask(address, f"/crops/{one}")[0] == 200)
        for picture in (f"/crops/{fruit}", f"/crops/{fruit}/1"):
            status, headers, body = ask(address, picture)
            assert (status, headers["content-type"], body) == (200, "image/webp", webp(7))
        for picture in (f"/crops/{fruit}/0", f"/crops/{fruit}/99", "/crops/99999999999999999999999"):
            assert ask(address, picture)[0] == 404


def test_a_map_that_is_gone_is_told_by_its_name(tmp_path: Path) -> None:
    path = grow_row(tmp_path / "orchard.gpkg", (50,), n_trees=1).path
    with served(path) as address:
        path.unlink()
        status, _, body = ask(address, "/season.json")
        assert (status, b"orchard.gpkg" in body, str(tmp_path).encode() in body) == (503, True, False)


def add_with_crop(path: Path) -> None:
    fruits = OrchardMap(path).fruits()
    rng = np.random.default_rng(1)
    grown_m = fruits.diameters_m + rng.normal(0.008, 0.001, len(fruits))
    cloud = FruitCloud(fruits.positions + rng.normal(0.0, 0.005, (len(fruits), 3)), diameters_m=grown_m)
    session = Session("later", date(2024, 7, 1).isoformat(), "drawn", cloud, crops={3: FruitCrop(0, webp(7))})
    assert add_session(path, session).is_added


def test_a_port_that_is_taken_is_told(pomona: Pomona, orchard: Path) -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        code, _, told = pomona("view", orchard, "--port", port)
    assert code == 2
    assert told == f"pomona: --host 127.0.0.1 --port {port}: cannot be listened on: Address already in use\n"


@pytest.mark.parametrize("name", ["session.gpkg", "other.sqlite", "missing.gpkg"])
def test_what_is_no_map_is_refused(pomona: Pomona, here: Path, name: str) -> None:
    for verb in (("view", name, "--port", 0), ("report", name, "-o", "report.html")):
        code, printed, told = pomona(*verb)
        assert (code, printed, told.count("\n")) == (2, "", 1)
        assert name in told
    assert not Path("report.html").exists()


def test_the_live_page_says_what_it_needs(orchard: Path) -> None:
    without = "import sys; sys.modules['fastapi'] = None; from pomona.cli import main; main()"
    command = [sys.executable, "-c", without, "view", str(orchard), "--port", "0"]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert done.returncode == 2
    assert "fastapi and uvicorn: pip install" in done.stderr


def test_an_odd_request_leaves_the_terminal_alone(orchard: Path) -> None:
    command = [sys.executable, "-m", "pomona", "view", str(orchard), "--port", "0"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        address = process.stdout.readline().strip()
        assert ask(address, "/", Connection="Upgrade", Upgrade="websocket")[0] == 200
        process.terminate()
        _, said = process.communicate()
    assert "WebSocket" not in said
