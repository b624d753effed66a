"""The command that prints JSON schemas: schema."""

import json
from typing import Literal

from hopopt.problem.schema import problem_schema
from hopopt.storage.summary import summary_schema


def schema(of: Literal["problem", "summary"]) -> int:
    """Print the JSON schema of problem or result files.

    Both also lie in the package's folder schemas.

    Editors complete and check problem files by it: see docs/own_leg.md.

    Parameters
    ----------
    of
        problem: of problem files (TOML); summary: of the summary.json in a results folder.
    """
    print(json.dumps(problem_schema() if of == "problem" else summary_schema(), indent=2))
    return 0
