"""The command that prints the paper's results beside the simulation's: reproduce."""

from hopopt.cli.options import AsJson, Overrides


def reproduce(problem: str = "paper", *, set_: Overrides = None, json_: AsJson = False) -> int:
    """Print the paper's results beside those of the simulation.

    As a Markdown table.

    Parameters
    ----------
    problem
        A problem file, or the name of a built-in one.
    """
    from hopopt.problem.load import load

    design = load(problem, set_ or ())
    from dataclasses import asdict

    from hopopt.control.closed_loop import simulate
    from hopopt.control.strategies import find
    from hopopt.paper.paper_results import is_the_papers, markdown, paper_results
    from hopopt.storage.folder import as_json

    force, *others = (simulate(design, find(name)).figures for name in ("force", "position", "position_soft"))
    names = ("position with force's k_p", "position_soft")
    columns = {name: paper_results(force, position) for name, position in zip(names, others, strict=True)}
    if json_:
        data = {name: [asdict(row) for row in rows] for name, rows in columns.items()}
        print(as_json({"problem": design.name, "the_papers_leg": is_the_papers(design.leg), "figures": data}))
    else:
        if not is_the_papers(design.leg):
            print(
                f"{design.name}: guides, body, links or joint axes are not the paper's, so its figures do not apply.\n"
            )
        print(markdown(columns))
    return 0
