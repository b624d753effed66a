"""What all that the command line shows a person has in common: lines, tables, progress."""

import sys
import textwrap
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from threading import Event, Thread
from typing import TYPE_CHECKING, Any, TextIO

from rich.console import Console
from rich.table import Table
from rich.text import Text

if TYPE_CHECKING:
    from hopopt.problem.load import Row
    from hopopt.verify.check import Check

ROOM = 100  # columns of a screen on which tables have all their columns
PIPED = 180  # columns of a table that no screen shows
EVERY = 10.0  # s between two lines of progress that is piped


def console() -> Console:
    """Standard output: sentences are broken between words on a screen, and whole lines when piped."""
    piped = not sys.stdout.isatty()
    return Console(highlight=False, markup=False, soft_wrap=piped, width=PIPED if piped else None)


def print_table(out: Console, table: Table) -> None:
    """A table, as wide as the screen."""
    out.print(table, soft_wrap=False)


@contextmanager
def progress(quiet: bool) -> Iterator[Callable[[str], None]]:
    """A function that shows one line of progress on standard error, which when piped is a new line every EVERY seconds;
    silent if ``quiet``."""
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
    """A function that is told of progress, the last of which is written every EVERY seconds, also if there is no more."""
    began, last, ended = time.monotonic(), "starting", Event()

    def write() -> None:
        while not ended.wait(EVERY):
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


def print_lines(out: Console, name: str, lines: Sequence[str]) -> None:
    """Lines under one name; broken on a screen, where each goes on below its own beginning, but not when piped."""
    for k, line in enumerate(lines):
        head = f"  {name if k == 0 else '':9s} "
        if out.is_terminal:
            below = " " * (len(head) + 2)
            head = textwrap.fill(
                line, max(out.width, 40), initial_indent=head, subsequent_indent=below,
                break_long_words=False, break_on_hyphens=False,
            )  # fmt: skip
            line = ""
        out.print(f"{head}{line}")


def print_rows(title: str, rows: "Sequence[Row]") -> None:
    """Every entry of a problem with value, unit and meaning."""
    table = Table(title=title, title_justify="left", box=None, pad_edge=False)
    for column, style in (("entry", "bold"), ("value", ""), ("unit", "dim"), ("meaning", "")):
        table.add_column(column, style=style, overflow="fold")
    for row in rows:
        unset = "by default" if "(default" in row.meaning else "not set"
        table.add_row(row.path, unset if row.value is None else _plain(row.value), row.unit, row.meaning)
    print_table(console(), table)


def _plain(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"  # as a file has it
    return ", ".join(map(_plain, value)) or "none" if isinstance(value, (list, tuple)) else str(value)


def print_checks(title: str, checks: "Sequence[Check]") -> None:
    """Every check with its residual and tolerance, and how many passed."""
    print_residuals(title, "check", checks)
    bad, left_out = sum(not c.passed for c in checks), [c for c in checks if c.left_out]
    out, made = console(), len(checks) - len(left_out)
    out.print(f"{title}: {made - bad} of {made} checks passed")
    if left_out:
        out.print(f"left out: {', '.join(c.name for c in left_out)} ({left_out[0].left_out})")


def print_residuals(title: str, kind: str, checks: "Sequence[Check]") -> None:
    """A table of checks; where the worst is stands in it where there is room, else below it of those that failed."""
    out = console()
    room = out.width >= ROOM
    table = Table(title=title, title_justify="left", box=None, padding=(0, 2 if room else 1, 0, 0), pad_edge=False)
    for column in (kind, "residual", "allowed", "unit", "", *(["worst"] if room else [])):
        table.add_column(column, no_wrap=column == kind)
    for c in checks:
        state = "left out" if c.left_out else "ok" if c.passed else "FAILED"
        residual = "" if c.left_out else f"{c.residual:.1e}"
        cells = [c.name, residual, f"{c.tolerance:.0e}", c.unit, state, c.where]
        table.add_row(*cells[: len(table.columns)])
    print_table(out, table)
    for c in checks:
        if c.where and not c.passed and not room:
            out.print(f"FAILED {c.name}: {c.where}")
