"""`pomona config`: every setting with its effective value."""

from __future__ import annotations

from pathlib import Path

from pomona.cli.match_options import (
    Method,
    Scale,
    call_flags,
    config_option,
    method_option,
    noise_option,
    per_frame_option,
    scale_option,
    threads_option,
    up_option,
)
from pomona.cli.terminal import say


def config(
    config: Path | None = config_option,
    method: Method | None = method_option,
    scale: Scale | None = scale_option,
    noise_m: float | None = noise_option,
    up: list[str] | None = up_option,
    per_frame: bool | None = per_frame_option,
    threads: int | None = threads_option,
) -> None:
    """Print the settings that a match would run with, as TOML: flags beat the file, the file beats the defaults."""
    from pomona.settings import Settings

    say(*Settings.load(config, call_flags(method, scale, noise_m, up, per_frame, threads)).as_toml().split("\n"))
