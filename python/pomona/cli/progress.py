"""A sign of life on the standard error, for people only."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from pomona.cli.terminal import shown


@contextmanager
def working(what: str) -> Iterator[None]:
    """Show what is going on while the block runs; nothing where the standard error is no terminal."""
    from rich.console import Console
    from rich.text import Text

    console = Console(stderr=True)
    if not console.is_terminal:
        yield
        return
    with console.status(Text(shown(f"{what} ..."))):
        yield


@contextmanager
def counting(what: str, total: int | None = None) -> Iterator[Callable[[int, int], None]]:
    """Show how much of a count is done while the block runs; nothing where the standard error is no terminal."""
    from rich.console import Console
    from rich.progress import Progress

    console = Console(stderr=True)
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task(what, total=total)
        yield lambda done, total: bar.update(task, completed=done, total=total)


@contextmanager
def first_interrupt() -> Iterator[Callable[[], bool]]:
    """Give a question: was Ctrl-C pressed? The first one is only noted, the second ends the program as ever."""
    import signal
    import threading

    asked = threading.Event()
    before = signal.getsignal(signal.SIGINT)

    def note(_number: int, _frame: object) -> None:
        asked.set()
        signal.signal(signal.SIGINT, before)

    signal.signal(signal.SIGINT, note)
    try:
        yield asked.is_set
    finally:
        signal.signal(signal.SIGINT, before)
