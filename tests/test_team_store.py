"""Maps in a real PostGIS: whole for readers, row by row the same, and nothing lost when the server dies."""

import contextlib
import os
import shutil
import socket
import sqlite3
import subprocess
import sys
import threading
import time
from dataclasses import replace
from urllib.parse import quote

import pytest

import postgres_server
from pomona.errors import PomonaError
from pomona.orchard import OrchardMap, add_sessions, load_session, problems, remove_session
from pomona.orchard.hanging import may_hang
from pomona.store.schema import FORMAT_VERSION, LAYERS
from pomona.synth.seasons import SEASONS, draw_season
from pomona.synth.seasons.season_files import write_season
from pomona.team import pull_map, push_map
from pomona.team.database_url import parsed_url
from qgis_program import require_qgis, seen_by_qgis

pg = pytest.importorskip("pg8000.native", reason="pg8000 is not installed: pip install pg8000")
pytestmark = pytest.mark.skipif(
    postgres_server.programs() is None,
    reason="no PostgreSQL with PostGIS: apt-get install postgresql postgresql-15-postgis-3",
)


@pytest.fixture(scope="module")
def server():
    with postgres_server.running_server() as running:
        yield running


@pytest.fixture(scope="module")
def maps(tmp_path_factory):
    """A map of three visits, and one of another row."""
    folder = tmp_path_factory.mktemp("maps")
    easy = SEASONS["easy"]
    plan = replace(easy, n_visits=3, design=replace(easy.design, n_trees=2, fruits_per_tree=(20, 25)))
    for seed, name in enumerate(("row", "other")):
        write_season(draw_season(plan, seed), folder / f"{name}_visits")
        sessions = [load_session(path, date=path.stem) for path in sorted((folder / f"{name}_visits").glob("2*.csv"))]
        add_sessions(folder / f"{name}.gpkg", sessions)
    return folder


@pytest.fixture
def row(maps, tmp_path):
    shutil.copy(maps / "row.gpkg", tmp_path)
    return tmp_path / "row.gpkg"


@pytest.fixture
def database(server, request):
    """An empty database of the test's own."""
    name = f"t{abs(hash(request.node.name))}"
    with connection(server) as admin:
        admin.run(f"CREATE DATABASE {name}")
    return server.url_of(postgres_server.USER, postgres_server.PASSWORD, name)


@contextlib.contextmanager
def connection(server, url=None, user=postgres_server.USER, password=postgres_server.PASSWORD):
    name = "postgres" if url is None else parsed_url(url).name
    opened = pg.Connection(user, host="127.0.0.1", port=server.port, database=name, password=password)
    try:
        yield opened
    finally:
        with contextlib.suppress(pg.InterfaceError, OSError):
            opened.close()


def content(path):
    with contextlib.closing(sqlite3.connect(path)) as opened:
        rows = {layer: opened.execute(f"SELECT * FROM {layer} ORDER BY id").fetchall() for layer, *_ in LAYERS}
        rows["numbers"] = opened.execute("SELECT name, seq FROM sqlite_sequence WHERE seq > 0 ORDER BY name").fetchall()
    return rows


def push(path, url, *flags):
    return subprocess.run(
        [sys.executable, "-m", "pomona", "map", "push", str(path), url, *flags],
        capture_output=True,
        text=True,
        check=False,
    )


def test_what_is_pulled_is_what_was_pushed_and_pushing_again_changes_nothing(server, database, row, tmp_path):
    first = push_map(row, parsed_url(database))
    assert first.n_written == sum(len(rows) for layer, rows in content(row).items() if layer != "numbers")
    assert push_map(row, parsed_url(database)) == replace(first, n_written=0, n_ended=0)
    pulled = tmp_path / "pulled.gpkg"
    assert pull_map(parsed_url(database), "row", pulled) == len(content(row)["fruits"])
    assert content(pulled) == content(row)
    assert problems(pulled) == []
    assert push_map(pulled, parsed_url(database), name="row").n_written == 0
    with connection(server, database) as reader:
        assert reader.run("SELECT count(*) FROM pomona.pushes") == [[1]]


def test_a_pulled_map_goes_on_as_the_one_that_was_pushed(database, maps, tmp_path):
    sessions = [load_session(path, date=path.stem) for path in sorted((maps / "row_visits").glob("2*.csv"))]
    mine = tmp_path / "row.gpkg"
    add_sessions(mine, sessions[:2])
    push_map(mine, parsed_url(database))
    pull_map(parsed_url(database), "row", tmp_path / "theirs.gpkg")
    add_sessions(tmp_path / "theirs.gpkg", sessions[2:])
    add_sessions(mine, sessions[2:])
    assert content(tmp_path / "theirs.gpkg") == content(mine)


def test_versions_of_rows_are_kept_and_sessions_only_go_when_that_is_said(server, database, row):
    push_map(row, parsed_url(database))
    before = len(content(row)["observations"])
    name = content(row)["sessions"][1][1]
    remove_session(row, name)
    with pytest.raises(PomonaError, match=f"map row has the session {name}, which the file has not"):
        push_map(row, parsed_url(database))
    push_map(row, parsed_url(database), drop_sessions=True)
    with connection(server, database) as reader:
        ((now,),) = reader.run("SELECT count(*) FROM pomona_now.observations WHERE map = 'row'")
        ((ended,),) = reader.run("SELECT count(DISTINCT id) FROM pomona.observations WHERE until_push IS NOT NULL")
        ((then,),) = reader.run("SELECT count(*) FROM pomona.observations WHERE since_push = 1")
    assert now == len(content(row)["observations"]) < before == then
    assert ended >= before - now


def test_another_orchard_of_the_same_name_is_refused(database, row, maps):
    push_map(row, parsed_url(database))
    with pytest.raises(PomonaError, match="has another map row, without a session of this one"):
        push_map(maps / "other.gpkg", parsed_url(database), name="row")
    assert push_map(maps / "other.gpkg", parsed_url(database)).n_written


def test_readers_see_whole_maps_and_cannot_write(server, database, row):
    push_map(row, parsed_url(database))
    with connection(server, database) as admin:
        admin.run("DROP ROLE IF EXISTS anna")
        admin.run("CREATE ROLE anna LOGIN PASSWORD 'pear' IN ROLE pomona_reader")
    with connection(server, database, user="anna", password="pear") as anna:
        ((count,),) = anna.run("SELECT count(*) FROM pomona_now.fruits WHERE map = 'row'")
        assert count == len(content(row)["fruits"])
        ((n_fruits, diameter_mm),) = anna.run("SELECT n_fruits, mean_diameter_mm FROM pomona_now.row_summary")
        assert n_fruits == may_hang(OrchardMap(row).fruits()).sum(), "as everywhere"
        assert 10 < diameter_mm < 120
        places = anna.run(
            "SELECT type, coord_dimension, srid FROM geometry_columns "
            "WHERE f_table_schema = 'pomona_now' AND f_table_name = 'fruits'"
        )
        assert places == [["POINT", 3, 0]], "QGIS finds the layer by these"
        for statement in (
            "DELETE FROM pomona.fruits",
            "UPDATE pomona_now.fruits SET state = 'gone'",
            "DROP SCHEMA pomona CASCADE",
        ):
            with pytest.raises(pg.DatabaseError, match=r"permission denied|must be owner"):
                anna.run(statement)
    refused = push(row, server.url_of("anna", "pear", parsed_url(database).name), "--name", "mine")
    assert refused.returncode == 2
    assert "permission denied" in refused.stderr
    assert refused.stderr.count("\n") == 1


def test_qgis_opens_the_store(server, database, row, tmp_path):
    require_qgis()
    push_map(row, parsed_url(database))
    push_map(row, parsed_url(database), name="second")
    there = f"host=127.0.0.1 port={server.port} dbname={parsed_url(database).name}"
    who = f"user={postgres_server.USER} password={postgres_server.PASSWORD}"
    layers = [f"""{there} {who} key='"map","id"' table="pomona_now"."{name}" (geom)""" for name in ("fruits", "trees")]
    fruits, trees = seen_by_qgis("postgres", *layers, home=tmp_path)
    assert (fruits["valid"], trees["valid"]) == (True, True)
    assert fruits["count"] == 2 * len(content(row)["fruits"])
    assert {"map", "state", "diameter_m"} <= set(fruits["fields"])
    assert len(fruits["colours"]) > 1, "something is drawn"


def wait_for_a_push_in_the_middle(reader):
    until = time.monotonic() + 60
    while not reader.run(
        "SELECT 1 FROM pg_stat_activity WHERE wait_event_type = 'Lock' AND application_name = 'pomona'"
    ):
        assert time.monotonic() < until
        time.sleep(0.05)


def test_a_server_killed_in_the_middle_of_a_push_keeps_the_map_as_it_was(server, database, row, tmp_path):
    push_map(row, parsed_url(database))
    before = content(row)
    remove_session(row, before["sessions"][2][1])
    with connection(server, database) as blocker:
        # The push comes as far as the last layer but a few, which somebody holds.
        blocker.run("BEGIN")
        blocker.run("LOCK TABLE pomona.crops IN ACCESS EXCLUSIVE MODE")
        with subprocess.Popen(
            [sys.executable, "-m", "pomona", "map", "push", str(row), database, "--drop-sessions"],
            stderr=subprocess.PIPE,
            text=True,
        ) as pushing:
            with connection(server, database) as reader:
                wait_for_a_push_in_the_middle(reader)
                ((seen,),) = reader.run("SELECT count(*) FROM pomona_now.observations WHERE map = 'row'")
                assert seen == len(before["observations"])
            server.kill()
            told = pushing.communicate()[1]
    assert pushing.returncode == 2
    assert told.count("\n") == 1
    assert "nothing was written" in told
    server.start()
    pull_map(parsed_url(database), "row", tmp_path / "after.gpkg")
    assert content(tmp_path / "after.gpkg") == before
    push_map(row, parsed_url(database), drop_sessions=True)
    pull_map(parsed_url(database), "row", tmp_path / "again.gpkg")
    assert content(tmp_path / "again.gpkg") == content(row)


def test_a_push_says_that_it_waits_for_another_of_the_same_map(server, database, row):
    push_map(row, parsed_url(database))
    with connection(server, database) as other:
        other.run("BEGIN")
        other.run("SELECT pg_advisory_xact_lock(hashtext('pomona'), hashtext('row'))")
        assert "waiting" not in push(row, database, "--name", "second").stderr, "another map waits for nobody"
        with subprocess.Popen(
            [sys.executable, "-m", "pomona", "map", "push", str(row), database], stderr=subprocess.PIPE, text=True
        ) as pushing:
            assert "another push of this map is at work" in pushing.stderr.readline()
            other.run("COMMIT")
            pushing.communicate()
    assert pushing.returncode == 0


def test_no_output_replaces_a_map(database, row):
    push_map(row, parsed_url(database))
    before = row.read_bytes()
    with pytest.raises(PomonaError, match="is there already, expected a new file"):
        pull_map(parsed_url(database), "row", row)
    assert row.read_bytes() == before


def test_a_password_is_shown_nowhere(server, row):
    secret = "hunter2%40x"
    wrong = [
        server.url_of("postgres", secret),
        f"postgresql://postgres:{secret}@127.0.0.1:1/orchards",
        f"mysql://postgres:{secret}@127.0.0.1/orchards",
        f"postgresql://postgres:{secret}@127.0.0.1:port/orchards",
        f"postgresql://postgres:{secret}@127.0.0.1",
        f"postgresql://postgres:{secret}@127.0.0.1/orchards?sslmode=maybe",
    ]
    for url in wrong:
        refused = push(row, url)
        assert refused.returncode == 2
        assert refused.stderr.count("\n") == 1
        assert "hunter2" not in refused.stderr + refused.stdout
    assert "127.0.0.1:1/orchards: nothing answers there" in push(row, wrong[1]).stderr
    fine = subprocess.run(
        [
            sys.executable,
            "-m",
            "pomona",
            "map",
            "pull",
            f"postgresql://postgres@127.0.0.1:{server.port}/postgres",
            "row",
            "-o",
            str(row.with_name("x.gpkg")),
        ],
        env={**os.environ, "PGPASSWORD": postgres_server.PASSWORD},
        capture_output=True,
        text=True,
        check=False,
    )
    assert "holds no maps of Pomona" in fine.stderr, "the password of the environment is taken"


def test_a_database_without_postgis_or_of_another_format_is_told(server, database, row):
    with connection(server, database) as admin:
        admin.run("DROP ROLE IF EXISTS ben")
        admin.run("CREATE ROLE ben LOGIN PASSWORD 'plum'")
    refused = push(row, server.url_of("ben", "plum", parsed_url(database).name))
    assert refused.returncode == 2
    assert "has no PostGIS yet, ask its administrator for: CREATE EXTENSION postgis" in refused.stderr
    push_map(row, parsed_url(database))
    with connection(server, database) as admin:
        admin.run("UPDATE pomona.format SET format_version = 99")
    with pytest.raises(PomonaError, match=f"holds maps of format 99, expected {FORMAT_VERSION}"):
        push_map(row, parsed_url(database))
    with pytest.raises(PomonaError, match="holds maps of format 99"):
        pull_map(parsed_url(database), "row", row.with_name("pulled.gpkg"))
    assert not row.with_name("pulled.gpkg").exists()


def run_verb(*words, **environment):
    command = [sys.executable, "-m", "pomona", *map(str, words)]
    given = {name: value for name, value in os.environ.items() if name != "PGPASSWORD"} | environment
    return subprocess.run(command, capture_output=True, text=True, check=False, env=given, timeout=120)


def test_the_team_has_roles_as_soon_as_someone_may_make_them(server, database, row):
    """Whoever pushes first may not; then an administrator makes the roles, and a push without change helps."""
    name = parsed_url(database).name
    with connection(server, database) as admin:
        # Roles are the whole server's: those of other tests have no rights in this database.
        for role in ("pomona_reader", "pomona_writer"):
            admin.run(f"DO $$ BEGIN CREATE ROLE {role}; EXCEPTION WHEN duplicate_object THEN NULL; END $$")
            admin.run(f"ALTER ROLE {role} RENAME TO hidden_{role}")
        try:
            admin.run("CREATE EXTENSION postgis")
            admin.run("CREATE ROLE first LOGIN PASSWORD 'plum'")
            admin.run(f"GRANT CREATE ON DATABASE {name} TO first")
            url = server.url_of("first", "plum", name)
            pushed = run_verb("map", "push", row, url)
            assert pushed.returncode == 0
            assert "warning" in pushed.stderr
            assert "CREATE ROLE pomona_reader" in pushed.stderr
        finally:
            for role in ("pomona_reader", "pomona_writer"):
                admin.run(f"ALTER ROLE hidden_{role} RENAME TO {role}")
        again = run_verb("map", "push", row, url)
        assert (again.stdout, again.stderr) == (f"{row.stem}: is there as it is\n", "")
        for user, role in (("berta", "pomona_reader"), ("carl", "pomona_writer")):
            admin.run(f"CREATE ROLE {user} LOGIN PASSWORD 'pear' IN ROLE {role}")
    with contextlib.closing(sqlite3.connect(row)) as opened:
        (last,) = opened.execute("SELECT name FROM sessions ORDER BY id DESC").fetchone()
    remove_session(row, last)
    read = run_verb("map", "push", row, server.url_of("berta", "pear", name), "--drop-sessions")
    assert read.returncode == 2
    assert "permission denied" in read.stderr
    written = run_verb("map", "push", row, server.url_of("carl", "pear", name), "--drop-sessions")
    assert written.returncode == 0, written.stderr
    pulled = row.with_name("pulled.gpkg")
    pull_map(parsed_url(server.url_of("berta", "pear", name)), row.stem, pulled)
    assert content(pulled) == content(row)


@pytest.mark.parametrize(
    ("query", "told"),
    [
        ("?sslmod=verify-full", "'sslmod'"),
        ("?sslmode=disable&sslmode=verify-full", "'sslmode' twice"),
        ("?password=secret", "'password'"),
        ("#secret", "expected postgresql://"),
    ],
)
def test_what_an_address_cannot_say_is_refused(query, told):
    with pytest.raises(PomonaError, match=told) as refused:
        parsed_url(f"postgresql://anna@127.0.0.1/orchards{query}")
    assert "secret" not in str(refused.value)


def test_an_address_without_slashes_is_not_repeated():
    with pytest.raises(PomonaError, match="expected postgresql://") as refused:
        parsed_url("postgresql:anna:secret@127.0.0.1:5432/orchards")
    assert "secret" not in str(refused.value)


@pytest.mark.parametrize(("password", "told"), [(None, "PGPASSWORD"), ("\U0001f34e", ""), ("a\0b", "")])
def test_a_password_that_is_missing_or_cannot_be_said_is_one_line(server, row, password, told):
    url = f"postgresql://{postgres_server.USER}@127.0.0.1:{server.port}/postgres"
    if password is not None:
        url = server.url_of(postgres_server.USER, quote(password), "postgres")
    refused = run_verb("map", "push", row, url)
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
    assert told in refused.stderr


def test_a_store_that_says_no_format_is_told(server, database, row):
    push_map(row, parsed_url(database))
    with connection(server, database) as admin:
        admin.run("DELETE FROM pomona.format")
    with pytest.raises(PomonaError, match="holds maps of format none"):
        push_map(row, parsed_url(database))


def test_what_is_no_postgresql_is_told(row):
    with socket.socket() as listening:
        listening.bind(("127.0.0.1", 0))
        listening.listen()

        def answer():
            client, _ = listening.accept()
            client.recv(64)
            client.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n")
            client.close()

        threading.Thread(target=answer, daemon=True).start()
        refused = run_verb("map", "push", row, f"postgresql://anna:pear@127.0.0.1:{listening.getsockname()[1]}/o")
    assert refused.returncode == 2
    assert refused.stderr.count("\n") == 1
