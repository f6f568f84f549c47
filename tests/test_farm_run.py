"""A season of a small farm: done once, whatever is killed, and redone where something has changed."""

import contextlib
import importlib.util
import json
import os
import random
import shlex
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from pomona.store.schema import LAYERS
from pomona.synth.seasons import SEASONS, draw_season
from pomona.synth.seasons.season_files import write_season
from test_orchard_safety import on_a_small_disk

PLAN = """results = "results"
[recordings]
folder = "rec"
pattern = "{row}/{date}.csv"
[map]
[export]
to = ["csv"]
"""
ROWS = ("a", "b")


@pytest.fixture(scope="module")
def season(tmp_path_factory):
    """Two rows of two trees on three days, as clouds."""
    from dataclasses import replace

    folder = tmp_path_factory.mktemp("season")
    easy = SEASONS["easy"]
    plan = replace(easy, n_visits=3, design=replace(easy.design, n_trees=2, fruits_per_tree=(25, 30)))
    for seed, row in enumerate(ROWS):
        (folder / "rec" / row).mkdir(parents=True)
        write_season(draw_season(plan, seed), folder / row)
        for visit in sorted((folder / row).glob("2*.csv")):
            shutil.copy(visit, folder / "rec" / row)
        shutil.rmtree(folder / row)
    return folder


@pytest.fixture
def farm(season, tmp_path):
    shutil.copytree(season / "rec", tmp_path / "rec")
    (tmp_path / "farm.toml").write_text(PLAN, encoding="utf-8")
    return tmp_path


def command(*words: str) -> list[str]:
    return [sys.executable, "-m", "pomona", "farm", *words]


def run(farm: Path, *flags: str, code: int = 0) -> list[dict[str, object]]:
    """Run, and give the lines of JSON."""
    ran = subprocess.run(
        command("run", "farm.toml", "--json", *flags), cwd=farm, capture_output=True, text=True, check=False
    )
    assert ran.returncode == code, ran.stderr + ran.stdout
    return [json.loads(line) for line in ran.stdout.splitlines()]


@contextlib.contextmanager
def going(farm: Path, *flags: str) -> Iterator[subprocess.Popen[str]]:
    """A run that goes on while the block looks at it."""
    with subprocess.Popen(
        command("run", "farm.toml", "--json", *flags), cwd=farm, stdout=subprocess.PIPE, text=True
    ) as process:
        yield process


def visit_of(farm: Path, row: str, number: int) -> Path:
    return sorted((farm / "rec" / row).iterdir())[number]


def begun(lines: list[dict[str, object]]) -> set[object]:
    return {line["step"] for line in lines if line["event"] == "running"}


def content(farm: Path) -> dict[str, object]:
    """All that was made: tables by their bytes, maps by their rows."""
    made: dict[str, object] = {path.name: path.read_bytes() for path in (farm / "results" / "export").iterdir()}
    for path in sorted((farm / "results" / "maps").glob("*.gpkg")):
        with contextlib.closing(sqlite3.connect(path)) as opened:
            made[path.name] = {
                name: opened.execute(f"SELECT * FROM {name} ORDER BY id").fetchall() for name, *_ in LAYERS
            }
    return made


ALL = {f"{kind} {row}{suffix}" for row in ROWS for kind, suffix in (("map", ""), ("export", " csv"))}


def test_what_is_done_is_never_done_again_and_what_changes_redoes_what_follows_from_it(farm):
    assert begun(run(farm)) == ALL
    assert begun(run(farm)) == set()
    assert begun(run(farm, "--workers", "1")) == set()
    lines = visit_of(farm, "b", 1).read_text().splitlines(keepends=True)
    visit_of(farm, "b", 1).write_text("".join(lines[:-1]))
    assert begun(run(farm)) == {"map b", "export b csv"}
    os.utime(visit_of(farm, "a", 0))  # another time, the same content
    assert begun(run(farm)) == set()
    (farm / "results" / "export" / "a.csv").unlink()
    assert begun(run(farm)) == {"export a csv"}
    (farm / "farm.toml").write_text(PLAN + "observations = true\n")
    assert begun(run(farm)) == {f"export {row} csv" for row in ROWS}
    for row in ROWS:
        (farm / "results" / "export" / f"{row}.csv").write_text("")  # an emptied output is none
    assert begun(run(farm)) == {f"export {row} csv" for row in ROWS}
    assert not list(farm.glob("results/maps/*.before-*"))


def test_a_recording_that_is_no_longer_in_the_plan_stays_in_its_map(farm):
    run(farm)
    sessions = content(farm)["a.gpkg"]["sessions"]
    visit_of(farm, "a", 0).unlink()
    assert begun(run(farm)) == {"map a", "export a csv"}
    assert content(farm)["a.gpkg"]["sessions"] == sessions
    assert sorted(path.name for path in (farm / "results" / "maps").iterdir()) == ["a.gpkg", "b.gpkg"]


def test_what_only_looks_writes_nothing(farm):
    for words in (("run", "farm.toml", "--dry-run"), ("status", "farm.toml")):
        subprocess.run(command(*words), cwd=farm, capture_output=True, check=True)
        assert not (farm / "results").exists()
    run(farm)
    before = sorted((path, path.stat().st_mtime_ns) for path in farm.rglob("*"))
    looked = [
        subprocess.run(command(*words), cwd=farm, capture_output=True, text=True, check=True).stdout
        for words in (("run", "farm.toml", "--dry-run"), ("status", "farm.toml"))
    ]
    assert "pomona" not in looked[0]
    assert "4 kept" in looked[1]
    assert sorted((path, path.stat().st_mtime_ns) for path in farm.rglob("*")) == before


def test_a_farm_may_be_moved_and_made_by_hand(farm):
    """The commands that a dry run prints give what the farm gives."""
    dry = subprocess.run(command("run", "farm.toml", "--dry-run"), cwd=farm, capture_output=True, text=True, check=True)
    run(farm)
    made = content(farm)
    moved = farm.with_name(f"{farm.name}_moved")
    farm.rename(moved)
    assert begun(run(moved)) == set()
    shutil.rmtree(moved / "results")
    for folder in ("maps", "export"):
        (moved / "results" / folder).mkdir(parents=True)
    for line in dry.stdout.splitlines()[1:]:
        subprocess.run([sys.executable, "-m", *shlex.split(line)], cwd=moved, check=True, capture_output=True)
    assert content(moved) == made


def test_a_map_that_other_settings_made_is_kept_aside_and_made_anew(farm):
    run(farm)
    before = content(farm)
    (farm / "farm.toml").write_text(PLAN.replace("[map]", "[map]\nnoise = 0.03"))
    lines = run(farm)
    assert begun(lines) == ALL
    aside = sorted(path.name for path in (farm / "results" / "maps").glob("*.before-*.gpkg"))
    told = [str(line["reason"]) for line in lines if line["event"] == "done" and "map" in str(line["step"])]
    assert [sum(name in reason for reason in told) for name in aside] == [1] * len(ROWS)
    assert [name.split(".")[0] for name in aside] == list(ROWS)
    assert [content(farm)[name] for name in aside] == [before[f"{row}.gpkg"] for row in ROWS]


def test_one_recording_that_fails_stops_its_own_row_only(farm):
    broken = visit_of(farm, "b", 2)
    whole = broken.read_bytes()
    broken.write_text("x,y\n1,2\n")
    lines = run(farm, code=1)
    assert lines[-1]["fates"]["export a csv"] == "done"
    assert lines[-1]["fates"]["map b"] == "failed"
    assert lines[-1]["fates"]["export b csv"] == "blocked"
    assert broken.name in lines[-1]["reasons"]["map b"]
    status = subprocess.run(command("status", "farm.toml"), cwd=farm, capture_output=True, text=True, check=True)
    assert "\nb    x    -\n" in status.stdout
    assert f"map b: failed: {lines[-1]['reasons']['map b']}" in status.stdout
    skip = f'skip = ["b/{broken.stem}"]'
    assert lines[-1]["reasons"]["map b"].endswith(f"; the row goes on without it by {skip} in the plan's [recordings]")
    (farm / "farm.toml").write_text(PLAN.replace("[map]", f"{skip}\n[map]"))
    assert begun(run(farm)) == {"map b", "export b csv"}
    (farm / "farm.toml").write_text(PLAN)
    broken.write_bytes(whole)
    assert begun(run(farm)) == {"map b", "export b csv"}


def test_a_row_goes_on_without_a_visit_that_has_no_fruits(farm):
    empty = visit_of(farm, "b", 1)
    empty.write_text(empty.read_text().splitlines(keepends=True)[0])
    reasons = run(farm, code=1)[-1]["reasons"]
    skip = f'skip = ["b/{empty.stem}"]'
    said = f"rec/b/{empty.name}: has no fruits, expected at least one; the row goes on without it by {skip}"
    assert reasons["map b"] == f"{said} in the plan's [recordings]"
    (farm / "farm.toml").write_text(PLAN.replace("[map]", f"{skip}\n[map]"))
    assert begun(run(farm)) == {"map b", "export b csv"}


def test_a_visit_of_another_row_is_not_found_and_told(farm):
    shutil.copy(visit_of(farm, "b", 1), visit_of(farm, "a", 1))
    lines = run(farm)
    assert lines[-1]["fates"]["map a"] == "incomplete"
    assert "not found in the map" in lines[-1]["reasons"]["map a"]
    assert lines[-1]["fates"]["export a csv"] == "done"
    assert begun(run(farm)) == set()


def test_a_recording_that_grows_while_it_is_worked_on_is_not_taken(farm):
    """What a step read is not what it was told: the step has failed, and is done again when the recording has ended."""
    first = visit_of(farm, "a", 0)
    with going(farm, "--workers", "1") as process:
        for line in process.stdout or ():
            if json.loads(line).get("step") == "map a":
                with first.open("a") as growing:
                    growing.write("\n")
                break
        rest = [json.loads(line) for line in process.stdout or ()]
    assert process.returncode == 1
    assert rest[-1]["reasons"]["map a"] == "its input changed while it was read, expected a recording that has ended"
    assert begun(run(farm)) == {"map a", "export a csv"}


def children(pid: int) -> list[int]:
    with contextlib.suppress(OSError):
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return []


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="children are found in /proc")
def test_killed_workers_and_killed_runs_leave_the_same_results(farm, tmp_path_factory):
    undisturbed = tmp_path_factory.mktemp("undisturbed") / "farm"
    shutil.copytree(farm, undisturbed)
    run(undisturbed, "--workers", "1")
    dice, done_before = random.Random(5), set()
    for number in range(12):
        with going(farm) as process:
            time.sleep(dice.uniform(0.3, 4.0))
            workers = children(process.pid)
            if number % 2:
                process.kill()
                require_gone(workers)
            else:
                for worker in workers:
                    with contextlib.suppress(ProcessLookupError):
                        os.kill(worker, signal.SIGKILL)
            lines = [json.loads(line) for line in process.stdout or () if line.endswith("\n")]
        assert not begun(lines) & done_before, "what was done was done again"
        done_before |= {line["step"] for line in lines if line["event"] == "done"}
        if process.returncode == 0:
            break
    run(farm)
    assert content(farm) == content(undisturbed)


def require_gone(workers: list[int]) -> None:
    """Workers end with the run that began them."""
    until = time.monotonic() + 30
    while any(Path(f"/proc/{worker}").exists() for worker in workers):
        assert time.monotonic() < until, "a worker outlives its run"
        time.sleep(0.05)


def test_two_runs_at_once_are_told_apart(farm):
    with going(farm) as process:
        assert process.stdout is not None
        process.stdout.readline()
        second = subprocess.run(command("run", "farm.toml"), cwd=farm, capture_output=True, text=True, check=False)
        status = subprocess.run(
            command("status", "farm.toml", "--json"), cwd=farm, capture_output=True, text=True, check=True
        )
        process.communicate()
    assert second.returncode == 2
    assert "another run is working on this farm" in second.stderr
    assert json.loads(status.stdout)["running"] is True
    assert process.returncode == 0


@pytest.mark.parametrize("kibibytes", [60, 600])
def test_a_full_disk_stops_what_needs_it_and_room_lets_it_go_on(farm, tmp_path_factory, kibibytes):
    undisturbed = tmp_path_factory.mktemp("undisturbed") / "farm"
    shutil.copytree(farm, undisturbed)
    run(undisturbed)
    disk = farm / "results"
    disk.mkdir()
    go = shlex.join(command("run", "farm.toml"))
    on_a_small_disk(
        disk,
        kibibytes * 1024,
        f"cd '{farm}'",
        f"{{ {go} >full.out 2>full.err; echo $? >full.code; }}",
        f"mount -o remount,size=20m '{disk}'",
        f"{go} >room.out 2>room.err",
        f"cp -r '{disk}' '{farm}/rescued'",
    )
    said = (farm / "full.out").read_text() + (farm / "full.err").read_text()
    assert (farm / "full.code").read_text().strip() in ("1", "2")
    assert "disk is full" in said
    assert "Traceback" not in said
    disk.rmdir()
    (farm / "rescued").rename(disk)
    assert content(farm) == content(undisturbed)


@pytest.fixture
def cluster():
    """Two machines of a core each."""
    pytest.importorskip("ray", reason="Ray is not installed: pip install ray")
    from ray.cluster_utils import Cluster

    machines = Cluster(initialize_head=True, head_node_args={"num_cpus": 1, "include_dashboard": False})
    yield machines, machines.add_node(num_cpus=1)
    machines.shutdown()


def test_a_cluster_gives_what_one_machine_gives_though_a_node_dies(farm, tmp_path_factory, cluster):
    machines, second = cluster
    undisturbed = tmp_path_factory.mktemp("undisturbed") / "farm"
    shutil.copytree(farm, undisturbed)
    run(undisturbed, "--workers", "1")
    with going(farm, "--ray", machines.address) as process:
        lines = []
        for line in process.stdout:
            lines.append(json.loads(line))
            if len(begun(lines)) == 2 and second is not None:
                machines.remove_node(second, allow_graceful=False)
                second = None
    assert process.returncode == 0
    assert begun(lines) == ALL
    assert second is None
    assert content(farm) == content(undisturbed)


@pytest.mark.parametrize(
    ("address", "told"),
    [("127.0.0.1:9", "127.0.0.1:9"), ("nonsense", "HOST:PORT"), ("127.0.0.1:99999", "127.0.0.1:99999")],
)
def test_a_dead_cluster_is_told_in_one_line(farm, address, told):
    refused = subprocess.run(
        command("run", "farm.toml", "--ray", address), cwd=farm, capture_output=True, text=True, check=False, timeout=60
    )
    assert refused.returncode == 2
    has_ray = importlib.util.find_spec("ray") is not None
    assert (told if has_ray else "Ray is not installed: pip install ray") in refused.stderr
    assert refused.stderr.count("\n") == 1
