"""The command that opens a live page: explore."""

import webbrowser
from pathlib import Path
from typing import Annotated

from hopopt import amounts
from hopopt.cli.options import AsJson, Overrides, Problem, Starts, repeated
from hopopt.live.server import Server, run
from hopopt.live.session import Session
from hopopt.problem.load import load
from hopopt.storage.folder import as_json, prepare

Entries = Annotated[
    list[str] | None,
    repeated(
        "--entry",
        "An entry that gets a slider, with its range if you like: leg.gear.ratio=60:160 (repeat; default: the ten most rewarding).",
    ),
]


def explore(
    problem: Problem = "paper",
    *,
    entry: Entries = None,
    objective: str = "clearance",
    set_: Overrides = None,
    starts: Starts = None,
    processes: int | None = None,
    port: int = 0,
    browser: bool = True,
    results: Path = Path("results"),
    json_: AsJson = False,
) -> int:
    """Drag the leg's numbers on a live page, and watch it hop.

    The page is for this computer alone. Every change is answered by a hop of the first mesh, marked preliminary. When the hands rest for a second it is verified.
    Ctrl-C ends it.

    Parameters
    ----------
    objective
        What to make as large or as small as possible, as in hopopt solve.
    processes
        How many starts side by side (default: one for each core).
    port
        The port to listen at, on this computer alone; 0: any that is free.
    browser
        Open the page in a browser.
    results
        Folder for verified hops, reports and problem files.
    """
    design = load(problem, set_ or ())
    amounts.check("starts", starts)
    amounts.check_processes(processes)
    server = Server(lambda tell: Session(design, objective, entry or (), results, starts, processes, tell), port)

    prepare(results)

    def opened(address: str) -> None:
        if json_:
            print(as_json({"address": address, "exit_code": 0}), flush=True)
        else:
            print(f"{design.name}: open {address} in a browser; Ctrl-C ends it", flush=True)
        if browser:
            webbrowser.open(address)

    run(server, opened)
    return 0
