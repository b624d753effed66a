"""The command that makes a page of results: report."""

from pathlib import Path

from hopopt.cli.options import AsJson, Output, some_results, write_new, written
from hopopt.report.result import page_of
from hopopt.storage.folder import fitting


def report(
    *results: Path,
    output: Output = Path("report.html"),
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
    """
    with fitting(some_results(results, "report")[0]):
        text = page_of(results)
    write_new(output, text, f", such as -o {output.stem}_2{output.suffix}")
    return written([output], json_, ": open it in a browser")
