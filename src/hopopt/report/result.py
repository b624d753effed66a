"""The page of whatever result a folder holds."""

from collections.abc import Sequence
from pathlib import Path

from hopopt.errors import UsageError
from hopopt.report.content import content_of
from hopopt.report.page import page
from hopopt.report.robust import is_robust, robust_page
from hopopt.report.study import study_page
from hopopt.studies.sweep.run import is_study


def page_of(folders: Sequence[Path]) -> str:
    """The HTML file of one result, or of several hops side by side.

    Raises ResultError for a folder that cannot be read, UsageError for results that do not go together on one page.
    """
    for folder in folders:
        made = study_page if is_study(folder) else robust_page if is_robust(folder) else None
        if made and len(folders) > 1:
            raise UsageError(
                f"{folder}: a {'study' if is_study(folder) else 'robust plan'} fills a page of its own: give it alone"
            )
        if made:
            return made(folder)
    return page(content_of(folders))
