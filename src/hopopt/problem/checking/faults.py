"""What was found wrong with a problem so far, and where each of its entries came from."""

import re
from dataclasses import dataclass, field
from pathlib import Path

from hopopt.problem.render import printable, shown_path

OVERRIDE = "override"  # where an entry came from if not from a file


@dataclass
class Report:
    """The faults found so far with the paths of their entries, and the file each entry came from; ``urdf``: that of the
    leg, if it has one; ``homes``: the folder that each robot's file must not lead out of."""

    source: str
    file: str = ""
    urdf: str | None = None
    origins: dict[str, str] = field(default_factory=dict)
    homes: dict[str, Path] = field(default_factory=dict)
    faults: list[tuple[str, str]] = field(default_factory=list)
    unreadable: bool = False

    @property
    def sentences(self) -> list[str]:
        """One for each fault, none twice."""
        return list(dict.fromkeys(sentence for _, sentence in self.faults))

    def add(self, path: str, words: str) -> None:
        """Note a fault of the entry at ``path``; ``words`` follow the path."""
        origin = self.origins.get(re.sub(r"\[\d+\]$", "", path), self.file)
        where = "override " if origin == OVERRIDE else f"{shown_path(origin)}: "
        from_urdf = origin == self.urdf
        if from_urdf and path.startswith("leg.motor."):  # a joint's, which is reported as such
            return
        instead = f"; write {path} in the problem file to replace it" if from_urdf and path.count(".") > 1 else ""
        self.fault(f"{where}{shown_path(path)} {words}{instead}", path)

    def fault(self, sentence: str, path: str = "") -> None:
        """Note a fault as a whole sentence."""
        self.faults.append((path, printable(sentence if sentence.endswith("?") else f"{sentence}.")))

    def unusable(self, sentence: str) -> None:
        """Note that a file could not be had, so that there is nothing to check."""
        self.fault(sentence)
        self.unreadable = True

    def clean(self, section: str) -> bool:
        """Whether no entry of a section has a fault so far."""
        return not any(re.split(r"[.\[]", path)[0] == section for path, _ in self.faults)
