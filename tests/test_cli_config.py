"""`pomona config`, and settings files that are wrong, as a user meets them."""

import json
import re
import tomllib
from pathlib import Path

import pytest

from command_line import Run, assert_refused, run, write_visits


@pytest.fixture(scope="module")
def visits(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_visits(tmp_path_factory.mktemp("visits"))


@pytest.mark.parametrize("verb", ["match", "config"])
@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("nonsense = 1\n", ["settings.toml", "nonsense"]),
        ("[match]\nnonsense = 1\n", ["settings.toml", "match.nonsense", "method"]),
        ("[paper]\nnonsense = 1\n", ["settings.toml", "paper.nonsense"]),
        ("paper = 1\n", ["settings.toml", "paper", "table"]),
        ("[match\n", ["settings.toml", "TOML"]),
        ('[match]\nmethod = "magic"\n', ["settings.toml", "match.method", "magic", "paper"]),
        ("[match]\nscale = 3\n", ["settings.toml", "match.scale", "3"]),
        ("[match]\nnoise_m = true\n", ["settings.toml", "match.noise_m"]),
        ("[match]\nthreads = -1\n", ["settings.toml", "match.threads", "-1"]),
        ("[match]\nup = [0, 1]\n", ["settings.toml", "match.up", "[0, 1]"]),
        (
            '[paper]\nmin_inliers = "x"\n',
            ["settings.toml: paper.min_inliers: found 'x', expected a whole number from 0"],
        ),
        ("[paper]\nransac.seed = -3\n", ["settings.toml: paper.ransac.seed: found -3, expected a whole number from 0"]),
        ("[localization]\nwindow_frames = 1.5\n", ["localization.window_frames: found 1.5, expected a whole number"]),
        ("[verified]\nmin_probability = true\n", ["verified.min_probability: found True, expected a number"]),
        ("[localization]\nown_m = nan\n", ["settings.toml: localization.own_m: found nan, expected a finite number"]),
        ("[constellation]\nk = 9\n", ["settings.toml", "constellation.k", "9", "4 to 7"]),
    ],
)
def test_refuses_wrong_settings(
    run_here: Run, visits: Path, tmp_path: Path, verb: str, text: str, named: list[str]
) -> None:
    (tmp_path / "settings.toml").write_text(text)
    clouds = [visits / "query.csv", visits / "map.csv"] if verb == "match" else []
    assert_refused(run_here(verb, *clouds, "--config", tmp_path / "settings.toml"), *named)


def test_config_prints_effective_values(run_here: Run, tmp_path: Path) -> None:
    defaults = tomllib.loads(run_here("config").stdout)
    assert defaults["match"]["method"] == "verified"
    path = tmp_path / "settings.toml"
    path.write_text('[match]\nmethod = "paper"\nnoise_m = 0.03\nup = [0, 1, 0]\n')
    from_file = tomllib.loads(run_here("config", "--config", path).stdout)
    up = [[0, 1, 0], [0, 1, 0]]
    assert from_file["match"] == {**defaults["match"], "method": "paper", "noise_m": 0.03, "up": up}
    flags_win = tomllib.loads(run_here("config", "--config", path, "--method", "verified", "--up", "0,0,1").stdout)
    assert flags_win["match"]["method"] == "verified"
    assert flags_win["match"]["noise_m"] == 0.03
    assert flags_win["match"]["up"] == [[0.0, 0.0, 1.0], [0.0, 0.0, 1.0]]


def test_config_reads_back_what_it_prints(run_here: Run, visits: Path, tmp_path: Path) -> None:
    path = tmp_path / "settings.toml"
    path.write_text(run_here("config").stdout)
    assert run_here("config", "--config", path).stdout == path.read_text()
    match = ("match", visits / "query.csv", visits / "map.csv", "--json")
    found, again = (json.loads(run_here(*match, *flags).stdout) for flags in ((), ("--config", path)))
    assert {**again, "elapsed_s": 0} == {**found, "elapsed_s": 0}


def test_config_says_what_each_setting_means(run_here: Run) -> None:
    lines = run_here("config").stdout.splitlines()
    for number, line in enumerate(lines):
        if re.match(r"\w+ = |# \w+ is not set$|\[", line):
            assert lines[number - 1].startswith("# "), line
            assert not lines[number - 1].endswith("is not set"), line
    assert max(map(len, lines)) <= 120
    # From the comments of the core, and from the docstring of `pomona.match`.
    assert "# Standard deviation of one edge of a box, pixels.\nedge_sigma_px = 1.0" in "\n".join(lines)
    assert '# "verified", or "paper" for the published method.\nmethod = "verified"' in "\n".join(lines)


@pytest.mark.parametrize("name", ["-", "/dev/fd/0"])
def test_config_comes_from_what_is_open_already(name: str) -> None:
    done = run("config", "--config", name, stdin="[match]\nnoise_m = 0.03\n")
    assert done.returncode == 0, done.stderr
    assert tomllib.loads(done.stdout)["match"]["noise_m"] == 0.03
    done = run("config", "--config", name, stdin="[match]\nnoise = 0.03\n")
    assert done.returncode == 2
    assert done.stderr.startswith(f"pomona: {name}: unknown setting match.noise, expected one of ")
