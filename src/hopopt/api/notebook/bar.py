"""A bar that shows in a notebook, below the cell, how far a call has come; it is gone when the cell has ended."""

import re
import sys
import time
from html import escape
from typing import Any
from uuid import uuid4

COUNTED = re.compile(r"(\d+) of (\d+)")  # what a line of progress says of how much is done


def shell_of_a_notebook() -> Any:
    """The shell of the kernel that runs this cell; None outside a notebook."""
    shell: Any = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return shell if getattr(shell, "kernel", None) is not None else None


class Bar:
    """Told a line of text, it shows it, with a bar as long as the share that the line says is done.

    shell: that shows it, and tells when the cell has ended
    """

    def __init__(self, shell: Any):
        self.shell, self.name, self.began, self.shown = shell, uuid4().hex, time.monotonic(), False
        shell.events.register("post_run_cell", self.close)

    def __call__(self, text: str) -> None:
        found = COUNTED.search(text)
        share = f' value="{int(found[1])}" max="{int(found[2])}"' if found else ""
        since = f"{time.monotonic() - self.began:.0f} s"
        self._show(f"<progress{share}></progress> {since}: {escape(text)}", text)

    def close(self, *of_cell: object) -> None:
        """Show nothing any more."""
        self.shell.events.unregister("post_run_cell", self.close)
        if self.shown:
            self._show("", "")

    def _show(self, html: str, text: str) -> None:
        data, transient = {"text/html": html, "text/plain": text}, {"display_id": self.name}
        self.shell.display_pub.publish(data=data, metadata={}, transient=transient, update=self.shown)
        self.shown = True
