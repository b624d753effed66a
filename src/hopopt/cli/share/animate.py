"""The command that makes a moving picture of results: animate."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from hopopt.cli.options import AsJson, some_results, written
from hopopt.cli.screen.console import progress
from hopopt.errors import UsageError
from hopopt.plots import animation
from hopopt.report.content import content_of
from hopopt.storage.folder import fitting


def animate(
    *results: Path,
    output: Annotated[Path, Parameter(name=["--output", "-o"])] = Path("hop.gif"),
    slower: float = 4.0,
    json_: AsJson = False,
) -> int:
    """Write hops as a moving picture: GIF, SVG or MP4.

    They move in step, one over the other. An existing file is never overwritten.

    Parameters
    ----------
    results
        A folder that hopopt solve, compare or robust wrote; or up to four solved hops of legs with the same joints.
    output
        The file to write: .gif, .svg (moves in a browser), or .mp4 (needs ffmpeg).
    slower
        How many seconds a second takes, from 1 to 100.
    """
    if not 1 <= slower <= 100:
        raise UsageError(f"--slower {slower:g}: from 1 to 100 are allowed")
    with progress(quiet=json_) as say:
        with fitting(some_results(results, "animate")[0]):
            content = content_of(results)
        say("drawing")
        animation.animate(content.hops, content.design.title or content.design.name, output, slower)
    return written([output], json_)
