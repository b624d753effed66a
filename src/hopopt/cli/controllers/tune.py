"""The command that finds the best gains of the paper's strategies: tune."""

from hopopt import amounts
from hopopt.cli.expected_time import ExpectedTime
from hopopt.cli.options import AsJson, Overrides, Problem, ended
from hopopt.cli.screen.console import as_is, progress
from hopopt.comparison import gain_tuning
from hopopt.problem.load import load


def tune(
    problem: Problem = "paper",
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
    strategy
        Which to tune, separated by commas: force, position.
    evaluations
        How many hops to simulate for each.
    seed
        Seed of the search; the same seed gives the same gains.
    processes
        How many simulations side by side (default: one for each core).
    """
    design = load(problem, set_ or ())
    amounts.check("evaluations", evaluations)
    amounts.check_processes(processes)
    names = list(dict.fromkeys(name.strip() for name in strategy.split(",") if name.strip()))
    gain_tuning.check_search(design, names, evaluations, seed)  # all of them, before the first
    expected = ExpectedTime("tune", design, {"simulated hop": float(evaluations * len(names))})
    with progress(json_, expected) as say:
        asked = {"evaluations": evaluations, "seed": seed, "processes": processes}
        found = [gain_tuning.tune(design, name, **asked, progress=say) for name in names]
    data = {"problem": design.name, "seed": seed, "strategies": {t.strategy: t.as_dict() for t in found}}
    return ended(data, json_, [as_is(gain_tuning.text(found))])
