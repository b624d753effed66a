"""The command that prints JSON schemas: schema."""

import json
from typing import Literal


def schema(of: Literal["problem", "summary"]) -> int:
    """Print the JSON schema of problem or result files.

    Both also lie in the package's folder schemas.

    Editors complete and check problem files by it: see docs/own_leg.md.

    Parameters
    ----------
    of
        problem: of problem files (TOML); summary: of the summary.json in a results folder.
    """
    if of == "problem":
        from hopopt.problem.schema import problem_schema as made
    else:
        from hopopt.storage.summary import summary_schema as made
    print(json.dumps(made(), indent=2))
    return 0
