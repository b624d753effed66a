"""The command that chooses motor and gear: choose."""

from contextlib import ExitStack
from pathlib import Path

from hopopt import amounts
from hopopt.cli.options import AsJson, Figures, Overrides, check_new, drawn, ended, write_new
from hopopt.cli.screen.console import progress, show
from hopopt.cli.screen.studies import of_choice, of_preliminary_choice
from hopopt.plots.studies.choice import save
from hopopt.problem.load import catalogue_of, load, resolved_toml
from hopopt.studies.choose.choice import Choice
from hopopt.studies.choose.each import choose_each
from hopopt.studies.choose.run import choose as chosen
from hopopt.studies.choose.run import written


def choose(
    problem: str | None = None,
    *,
    clearance: float,
    joints: str | None = None,
    only: str | None = None,
    each: bool = False,
    legs: int = 1,
    by: str = "mass",
    verify: int = 3,
    present_mass: float | None = None,
    write: Path | None = None,
    set_: Overrides = None,
    starts: int = 1,
    processes: int | None = None,
    scheduler: str | None = None,
    resume: Path | None = None,
    results: Path = Path("results"),
    figures: Figures = True,
    json_: AsJson = False,
) -> int:
    """Find the motors and gears that lift the foot so high.

    Every pair of the catalogue on this leg: those that clear, the lightest first, and what the others lack.
    The first few are verified, the others are preliminary: of coarse meshes alone.

    Exit code: 0 one clears and is verified, 1 none clears, 2 wrong usage, 3 none of those that clear is verified.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one (default: paper).
    clearance
        What the hop must clear [m].
    joints
        Joints whose drives are chosen, such as knee or hip,knee; the others keep theirs (default: all).
    only
        Motors and gears that are tried, by names or patterns such as "maxon-ec60*,csf-*" (default: all).
    each
        Let each of the joints have a pair of its own: the lightest combinations that clear.
    legs
        Legs of the robot whose body this leg carries: so many times one leg's drives weigh on it.
    by
        What is sorted by: mass, price, or energy or peak-power of the push in the highest hop.
    verify
        How many of the first are solved and verified in full.
    present_mass
        Mass of the present motors and gears of one leg's joints that are chosen [kg]; leg.body.mass counts them.
    write
        Write the leg with the first of those that clear as a problem file.
    starts
        Starting points of each that is verified, beside the hop that it has already; 6 search as solve does.
    processes
        How many pairs side by side (default: one for each core).
    scheduler
        Let the workers of a Dask scheduler do it: its address, or "local" for a cluster on this computer.
    resume
        The folder of a choice that was interrupted; ask for the same again beside it.
    results
        Folder for the results; each choice gets a new folder inside it.
    """
    design = load(problem or "paper", set_ or ())
    amounts.check_processes(processes)
    if write is not None:
        check_new(write)
    folders = [] if resume is None else [resume]
    listed, names = (None if text is None else [name.strip() for name in text.split(",")] for text in (joints, only))
    try:
        with ExitStack() as shown:
            say = [shown.enter_context(progress(json_))]

            def shown_first(found: Choice) -> None:
                shown.close()
                if not json_:
                    show(of_preliminary_choice(found))
                say.append(shown.enter_context(progress(json_)))

            found = (choose_each if each else chosen)(
                design, clearance, joints=listed, only=names, legs=legs, by=by, verify=verify, present_mass=present_mass, starts=starts,
                processes=processes, scheduler=scheduler, results=results, resume=resume,
                progress=lambda text: say[-1](text), opened=(lambda folder: None) if each else folders.append, listed=shown_first, entries=catalogue_of(problem or "paper", set_ or ()),
            )  # fmt: skip
            if figures and (folder := found.folder) is not None:
                say[-1]("drawing")
                safe = f"the data in {folder} are complete"
                drawn(lambda: save(found, folder / "figures"), "figures are missing", safe)
    except KeyboardInterrupt:
        if not folders:
            raise
        kept = f"interrupted; what is finished is kept: the same command with --resume {folders[-1]}"
        raise KeyboardInterrupt(kept) from None
    if write is not None and found.clearing:
        write_new(write, resolved_toml(written(found, found.clearing[0])))
    return ended(found.as_dict(), json_, of_choice(found, write), found.exit_code)
