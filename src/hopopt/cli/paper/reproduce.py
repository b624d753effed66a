"""The command that prints the paper's results beside the simulation's: reproduce."""

from dataclasses import asdict

from hopopt.cli.options import AsJson, Overrides, Problem, ended
from hopopt.cli.screen.console import as_is
from hopopt.control.closed_loop import simulate
from hopopt.control.strategies import find
from hopopt.paper.paper_results import is_the_papers, markdown, paper_results
from hopopt.problem.load import load

OTHER = "guides, body, links or joint axes are not the paper's, so its figures do not apply.\n"


def reproduce(problem: Problem = "paper", *, set_: Overrides = None, json_: AsJson = False) -> int:
    """Print the paper's results beside those of the simulation.

    As a Markdown table.
    """
    design = load(problem, set_ or ())
    force, *others = (simulate(design, find(name)).figures for name in ("force", "position", "position_soft"))
    names, ours = ("position with force's k_p", "position_soft"), is_the_papers(design.leg)
    columns = {name: paper_results(force, position) for name, position in zip(names, others, strict=True)}
    rows = {name: [asdict(row) for row in found] for name, found in columns.items()}
    words = [*([] if ours else [f"{design.name}: {OTHER}"]), markdown(columns)]
    return ended({"problem": design.name, "the_papers_leg": ours, "figures": rows}, json_, map(as_is, words))
