"""The command line: `pomona VERB`. One file per verb; each verb imports what it needs when it runs."""

import sys

import typer

from pomona.errors import PomonaError

app = typer.Typer(
    name="pomona",
    help="Finds the same fruits again.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


@app.callback()
def _pomona() -> None:
    """Find the same fruits again, visit after visit."""


def main() -> None:
    """Run the command line; wrong input is one line on stderr and exit code 2."""
    try:
        app()
    except PomonaError as error:
        sys.stderr.write(f"pomona: {error}\n")
        sys.exit(2)
