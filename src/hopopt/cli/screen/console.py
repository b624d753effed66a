"""How the command line shows anything to a person: lines, named parts, tables, progress."""

import sys
import textwrap
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from threading import Event, Thread
from typing import TYPE_CHECKING, TextIO

from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

if TYPE_CHECKING:
    from hopopt.cli.expected_time import ExpectedTime

WIDE_SCREEN = 100  # columns of a screen on which tables have all their columns
PIPED = 180  # columns of a table that no screen shows
PROGRESS_PERIOD = 10.0  # s between two lines of progress that is piped


@dataclass(frozen=True)
class NamedLines:
    """Lines under one name."""

    name: str
    lines: Sequence[str]


Shown = str | Text | Table | NamedLines  # what one output is made of, in order


def console() -> Console:
    """Standard output: sentences are broken between words on a screen, and whole lines when piped."""
    piped = not sys.stdout.isatty()
    return Console(highlight=False, markup=False, soft_wrap=piped, width=PIPED if piped else None)


def show(shown: Iterable[Shown]) -> None:
    """Print all of it; a table is as wide as the screen."""
    out = console()
    for what in shown:
        if isinstance(what, NamedLines):
            _print_part(out, what)
        else:
            out.print(what, soft_wrap=False if isinstance(what, Table) else None)


def marked(text: str) -> Text:
    """A line with words in [bold]; what a user wrote in it must be escaped."""
    return Text.from_markup(text)


def as_is(text: str) -> Text:
    """Lines that are never broken, as of a table that is text already."""
    return Text(text, no_wrap=True, overflow="ignore")


def table(
    columns: Iterable[Column | str],
    rows: Iterable[Sequence[str]],
    title: str | None = None,
    between: tuple[int, int] = (1, 1),
    edge: bool = False,
) -> Table:
    """A table without lines; ``between``: so many blanks stand on the left and on the right of each column; ``edge``: also
    of the first and the last."""
    left, right = between
    made = Table(*columns, title=title, title_justify="left", box=None, pad_edge=edge, padding=(0, right, 0, left))
    for row in rows:
        made.add_row(*row)
    return made


def named(head: str) -> Column:
    """A column of names, which are never broken."""
    return Column(head, style="bold", no_wrap=True)


def figures(*heads: str) -> list[Column]:
    """Columns of figures, flush right."""
    return [Column(head, justify="right", no_wrap=True) for head in heads]


def _print_part(out: Console, part: NamedLines) -> None:
    """Its lines broken on a screen, where each goes on below its own beginning, but not when piped."""
    for k, line in enumerate(part.lines):
        head = f"  {part.name if k == 0 else '':9s} "
        if out.is_terminal:
            below = " " * (len(head) + 2)
            head = textwrap.fill(
                line, max(out.width, 40), initial_indent=head, subsequent_indent=below,
                break_long_words=False, break_on_hyphens=False,
            )  # fmt: skip
            line = ""
        out.print(f"{head}{line}")


@contextmanager
def progress(quiet: bool, expected: "ExpectedTime | None" = None) -> Iterator[Callable[[str], None]]:
    """A function that shows one line of progress on standard error, which when piped is a new line every PROGRESS_PERIOD seconds;
    silent if ``quiet``. What is ``expected`` is said first and counted down, and how long it took is kept."""
    began = time.monotonic()
    if expected is not None and expected.first and not quiet:
        print(f"hopopt: {expected.first}", file=sys.stderr, flush=True)
    with _one_line(quiet) as say:
        if expected is None:
            yield say
        else:
            yield lambda text: say(f"{expected.left(time.monotonic() - began)}{text}")
    if expected is not None:
        expected.keep(time.monotonic() - began)


@contextmanager
def _one_line(quiet: bool) -> Iterator[Callable[[str], None]]:
    if quiet:
        yield lambda text: None
        return
    if not sys.stderr.isatty():
        with _now_and_then(sys.stderr) as say:
            yield say
        return
    screen = Console(stderr=True, highlight=False)
    with screen.status("starting") as status:
        yield lambda text: status.update(Text(textwrap.shorten(text, max(screen.width - 4, 20), placeholder=" …")))


@contextmanager
def _now_and_then(out: TextIO) -> Iterator[Callable[[str], None]]:
    """A function that is told of progress, the last of which is written every PROGRESS_PERIOD seconds, also if there is no more."""
    began, last, ended = time.monotonic(), "starting", Event()

    def write() -> None:
        while not ended.wait(PROGRESS_PERIOD):
            with suppress(OSError, ValueError):  # nobody reads it any more
                print(f"hopopt: after {time.monotonic() - began:.0f} s: {last}", file=out, flush=True)

    def say(text: str) -> None:
        nonlocal last
        last = text

    writer = Thread(target=write, daemon=True)
    writer.start()
    try:
        yield say
    finally:
        ended.set()
        writer.join()
