"""The command line: `pomona VERB`. One file per verb; each verb imports what it needs when it runs."""

import sys
import warnings
from pathlib import Path
from typing import NoReturn

import typer

from pomona import __version__
from pomona.cli import (
    config,
    demo,
    detect,
    evaluate,
    export,
    farm,
    growth,
    import_,
    info,
    localize,
    map,
    match,
    metric,
    report,
    ros,
    scan,
    synth,
    thinning,
    train,
    triangulate,
    validate,
    view,
)
from pomona.cli.terminal import READER_GONE, require_written, say, tell
from pomona.cli.verbs import Verbs
from pomona.errors import PomonaError, PomonaWarning
from pomona.reading import shown
from pomona.store.waiting import TIMEOUT_S, tell_waits

NOT_FOUND = "Input should be "
"""Begins what Typer says of a value that it does not take."""

app = Verbs(
    name="pomona",
    help="Finds the same fruits again.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)

# Typer does not export click's UsageError: it is what BadParameter derives from, whichever click typer carries.
_UsageError: type[Exception] = typer.BadParameter.__mro__[1]


def _print_version(wanted: bool) -> None:
    if wanted:
        say(__version__)
        raise typer.Exit


@app.callback()
def _pomona(
    version: bool = typer.Option(False, "--version", help="Print the version.", callback=_print_version, is_eager=True),
) -> None:
    """Find the same fruits again, visit after visit."""


# One line a verb, in the order of the work.
app.command()(demo.demo)
app.add_typer(import_.app, name="import")
app.command()(info.info)
app.command()(detect.detect)
app.command()(train.train)
app.command()(scan.scan)
app.command()(match.match)
app.add_typer(map.app, name="map")
app.command()(localize.localize)
app.add_typer(ros.app, name="ros")
app.command()(metric.metric)
app.command()(triangulate.triangulate)
app.command()(growth.growth)
app.command()(thinning.thinning)
app.command()(validate.validate)
app.command()(view.view)
app.command()(report.report)
app.command()(export.export)
app.add_typer(farm.app, name="farm")
app.command()(config.config)
app.add_typer(evaluate.app, name="evaluate")
app.add_typer(synth.app, name="synth")


def main() -> None:
    """Run the command line; wrong input is one line on stderr and exit code 2, a bug is a trace."""
    tell_waits(_say_waiting)
    try:
        code = _run()
    except PomonaError as error:
        _refuse(str(error))
    except _UsageError as error:
        _refuse(_usage_line(error))
    except SystemExit as error:
        # Of Click, which gives 1 where `head` has its lines and goes.
        if not isinstance(error.__context__, BrokenPipeError):
            raise
        code = READER_GONE
    except OSError as error:
        if error.filename is None:
            raise
        _refuse(f"{error.filename}: {error.strerror}")
    sys.exit(code if isinstance(code, int) else 0)


def _run() -> object:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("always", PomonaWarning)
            warnings.showwarning = _warn
            return app(standalone_mode=False)
    except OSError:
        require_written()  # the help is printed by Typer, past `say`
        raise


def _refuse(line: str) -> NoReturn:
    tell(f"pomona: {line}")
    sys.exit(2)


def _usage_line(error: Exception) -> str:
    """Say a usage error in one line, with where to read on."""
    message: str = getattr(error, "format_message", error.__str__)()
    message = message.replace(NOT_FOUND, f"{_found_by(error)}expected ", 1)
    context = getattr(error, "ctx", None)
    if context is None or not message or "\n" in message:
        return message or "no verb given, see `pomona --help`"
    return f"{message.rstrip('.')}; see `{context.command_path} --help`"


def _found_by(error: Exception) -> str:
    """Say what was found where Typer, which has Pydantic look at values, says only what was expected."""
    wrong: list[dict[str, object]] = getattr(error.__cause__, "errors", list)()
    return f"found {shown(wrong[0]['input'])}, " if wrong and "input" in wrong[0] else ""


def _say_waiting(path: Path) -> None:
    """Say why nothing happens."""
    tell(f"pomona: {path}: another program is using it, waiting up to {TIMEOUT_S:g} s")


def _warn(message: Warning | str, *_about: object, **_more: object) -> None:
    """Show a warning as one line on stderr."""
    tell(f"pomona: warning: {message}")
