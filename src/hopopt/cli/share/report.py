"""The command that makes a page of results: report."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hopopt.cli.options import AsJson, say_written, some_results, write_new


def report(
    *results: Path,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("report.html"),
    json_: AsJson = False,
) -> int:
    """Write results as one HTML page, with the hop moving.

    It has the answer, limits, evidence and parameters, and needs no network. Of a study it has the best point, a curve or map, and every point; of hopopt robust what a share of the legs reaches.

    An existing file is never overwritten.

    Parameters
    ----------
    results
        A folder that hopopt solve, compare, sweep or robust wrote; or up to four solved hops of legs with the same
        joints, which then move side by side.
    output
        The file to write.
    """
    from hopopt.report.result import page_of
    from hopopt.storage.folder import fitting

    with fitting(some_results(results, "report")[0]):
        text = page_of(results)
    write_new(output, text)
    say_written([output], json_, ": open it in a browser")
    return 0
