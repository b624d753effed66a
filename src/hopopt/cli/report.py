"""The command that makes a page of results: report."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hopopt.cli.options import AsJson, write_new


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
    from hopopt.errors import UsageError
    from hopopt.report.content import content_of
    from hopopt.report.page import page
    from hopopt.storage.folder import as_json, fitting

    if not results:
        raise UsageError(
            "give a folder that hopopt solve or hopopt compare wrote: hopopt report results/paper-0a1b2c3d"
        )
    with fitting(results[0]):
        text = page(content_of(results))
    write_new(output, text)
    print(as_json({"written": [str(output)], "exit_code": 0}) if json_ else f"{output} written: open it in a browser")
    return 0
