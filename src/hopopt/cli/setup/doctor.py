"""The command that looks at the installation: doctor."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict

from rich.table import Column

from hopopt.cli.options import AsJson, ended
from hopopt.cli.screen.console import Shown, progress, table
from hopopt.cli.setup.installation import Finding, findings


def doctor(*, json_: AsJson = False) -> int:
    """Check this installation, with a self-test.

    It looks at versions, solvers, the compiler and the cache; some seconds.

    Exit code: 0 all that hopopt needs works, 1 not.
    """
    found = list[Finding]()
    with progress(quiet=json_) as say:
        for finding in findings():
            say(f"looked at {finding.name}")
            found.append(finding)
    code = 0 if all(f.ok for f in found if f.needed) else 1
    data = {"works": code == 0, "exit_code": code, "findings": [asdict(f) for f in found]}
    return ended(data, json_, shown(found), code)


def shown(findings: Sequence[Finding]) -> Iterator[Shown]:
    """A table of everything that was looked at, then whether hopopt works here and what to do if not."""
    rows, before = list[list[str]](), ""
    for f in findings:
        state = "ok" if f.ok else "FAILED" if f.needed else "unusable"
        rows.append([f.group if f.group != before else "", f.name, f.found, state])
        before = f.group
    yield table([Column(head, overflow="fold") for head in ("", "name", "found", "state")], rows, between=(0, 2))
    yield from (f"{f.name}: {f.advice}" for f in findings if f.advice)
    works = all(f.ok for f in findings if f.needed)
    yield "hopopt works here" if works else "hopopt does NOT work here: see what failed above"
