"""How a verb comes to the command line: what it writes is looked at before it runs, Ctrl-C ends it in one line."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import typer

from pomona.cli.terminal import result_elsewhere, tell
from pomona.errors import PomonaError
from pomona.likes import Like
from pomona.outputs import Output, require_outputs
from pomona.streams import STANDARD_OUTPUT, is_standard_output

INTERRUPTED = 130
"""Exit code of what Ctrl-C ended, as shells have it."""

Verb = Callable[..., None]


def _nothing_else(_path: Path) -> Iterable[Path]:
    return ()


@dataclass(frozen=True)
class Writes:
    """Says of a verb's parameter that it is written: ``output: Annotated[Path, Writes(PAIRS)] = typer.Option(...)``.

    All other paths are taken for inputs. The verb gets `--force`.

    Attributes
    ----------
    like : Like or callable
        What will be written; a callable tells it from the other arguments, by name.
    also : callable
        Gives the files that may be written too when one is written there.
    """

    like: Like | Callable[[Mapping[str, Any]], Like]
    also: Callable[[Path], Iterable[Path]] = _nothing_else


class Verbs(typer.Typer):
    """A group of verbs, none of which destroys by what it writes."""

    def command(self, *names: Any, **options: Any) -> Callable[[Any], Any]:
        """Add a verb, as `typer.Typer.command` does."""
        register = super().command(*names, **options)

        def add(verb: Verb) -> Verb:
            register(_careful(verb))
            return verb

        return add


def _careful(verb: Verb) -> Verb:
    """Wrap a verb so that it is refused before it begins where an output would destroy something."""
    signature = inspect.signature(verb, eval_str=True)
    written = {name: mark for name, parameter in signature.parameters.items() if (mark := _mark(parameter))}

    @functools.wraps(verb)
    def run(**given: Any) -> None:
        force = bool(written) and given.pop("force")
        outputs = list(_outputs(written, given))
        to_standard_output = any(is_standard_output(output.path) for output in outputs)
        if to_standard_output and given.get("json"):
            raise PomonaError("-o and --json both go to the standard output, expected one of them")
        try:
            if outputs:
                require_outputs(outputs, _inputs(written, given), force=force)
            with result_elsewhere(to_standard_output):
                verb(**given)
        except KeyboardInterrupt:
            tell("pomona: interrupted")
            raise typer.Exit(INTERRUPTED) from None

    if written:
        _take_force(run, signature)
    return run


def _take_force(run: Verb, signature: inspect.Signature) -> None:
    option = typer.Option(False, "--force", help="Replace a file of another kind too; never an input or a map.")
    force = inspect.Parameter("force", inspect.Parameter.KEYWORD_ONLY, default=option, annotation=bool)
    run.__signature__ = signature.replace(parameters=[*signature.parameters.values(), force])  # type: ignore[attr-defined]
    run.__annotations__ = {**run.__annotations__, "force": bool}


def _mark(parameter: inspect.Parameter) -> Writes | None:
    return next((mark for mark in get_args(parameter.annotation) if isinstance(mark, Writes)), None)


def _outputs(written: Mapping[str, Writes], given: Mapping[str, Any]) -> Iterator[Output]:
    for name, mark in written.items():
        if (path := given[name]) is not None:
            like = mark.like if isinstance(mark.like, Like) else mark.like(given)
            yield Output(path, like)
            yield from (Output(further, like) for further in mark.also(path))


def _inputs(written: Mapping[str, Writes], given: Mapping[str, Any]) -> Iterator[Path]:
    for name, value in given.items():
        paths = value if isinstance(value, list | tuple) else [value]
        # Among inputs, the name of the standard output is that of the standard input.
        yield from (
            path for path in paths if isinstance(path, Path) and name not in written and path != STANDARD_OUTPUT
        )
