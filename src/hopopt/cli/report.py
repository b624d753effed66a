"""The command that makes a page of results: report."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hopopt.cli.options import AsJson, content_of_results, say_written, write_new


def report(
    *results: Path,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("report.html"),
    json_: AsJson = False,
) -> int:
    """Write results as one HTML page that needs no network: the answer, the hop moving, limits, evidence, parameters.

    An existing file is never overwritten.

    Parameters
    ----------
    results
        A folder that hopopt solve or hopopt compare wrote; or up to four solved hops of legs with the same joints, which
        then move side by side.
    output
        The file to write.
    """
    from hopopt.report.page import page
    from hopopt.storage.folder import fitting

    content = content_of_results(results, "report")
    with fitting(results[0]):
        text = page(content)
    write_new(output, text)
    say_written([output], json_, ": open it in a browser")
    return 0
