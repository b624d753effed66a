"""The command that finds the best gains of the paper's strategies: tune."""

from hopopt import amounts
from hopopt.cli.options import AsJson, Overrides, progress


def tune(
    problem: str = "paper",
    *,
    set_: Overrides = None,
    strategy: str = "force,position",
    evaluations: int = 60,
    seed: int = 0,
    processes: int | None = None,
    json_: AsJson = False,
) -> int:
    """Tune the gains of the paper's PD control by simulation.

    They are those of the greatest clearance. Every limit of the problem that a hop does not keep counts as 0.05 m less.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one.
    strategy
        Which to tune, separated by commas: force, position.
    evaluations
        How many hops to simulate for each.
    seed
        Seed of the search; the same seed gives the same gains.
    processes
        How many simulations side by side (default: one for each core).
    """
    from hopopt.problem.load import load

    design = load(problem, set_ or ())
    amounts.check("evaluations", evaluations)
    amounts.check_processes(processes)
    from hopopt.comparison import gain_tuning as gain_study
    from hopopt.storage.folder import as_json

    names = list(dict.fromkeys(name.strip() for name in strategy.split(",") if name.strip()))
    gain_study.check_search(design, names, evaluations, seed)  # all of them, before the first
    with progress(quiet=json_) as say:
        found = [
            gain_study.tune(design, name, evaluations=evaluations, seed=seed, processes=processes, progress=say)
            for name in names
        ]
    if json_:
        print(as_json({"problem": design.name, "seed": seed, "strategies": {t.strategy: t.as_dict() for t in found}}))
    else:
        print(gain_study.text(found))
    return 0
