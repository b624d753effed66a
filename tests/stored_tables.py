"""What studies wrote, as tests compare it."""

import csv
from pathlib import Path


def table(folder: Path) -> list[dict[str, str]]:
    """A study's table without its timings."""
    with (folder / "table.csv").open(encoding="utf-8") as file:
        return [{name: text for name, text in row.items() if name != "seconds"} for row in csv.DictReader(file)]
