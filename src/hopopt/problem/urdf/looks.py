"""How the leg of a problem with a URDF looks: a design holds numbers only, so the file is read again."""

from collections.abc import Sequence
from pathlib import Path

from hopopt.errors import UsageError
from hopopt.files import read_regular
from hopopt.leg.files.urdf_visuals import Visual, visuals
from hopopt.leg.files.urdf_xml import MAX_BYTES, UrdfError
from hopopt.problem.load import builtin_names, urdf_of


def looks_of(problem: str, joints: Sequence[str]) -> list[Visual]:
    """What the URDF of a problem file says of the looks of a leg with these joints; UsageError if it says nothing."""
    given = urdf_of(problem)
    if given is None:
        raise UsageError(f"{problem}: this problem has no leg.urdf, so it says nothing of looks")
    file = Path(given["urdf"])
    try:
        raw = read_regular(file, MAX_BYTES + 1)
        return visuals(raw, file.parent, joints, given["foot_frame"], given.get("locked", {}))
    except (UrdfError, OSError, KeyError) as error:
        raise UsageError(f"{problem}: {file.name} does not fit this hop: {error}") from None


def looks_if_known(name: str, joints: Sequence[str]) -> list[Visual]:
    """The same of a built-in problem of that name; nothing where there is none, or its URDF is not installed."""
    try:
        return looks_of(name, joints) if name in builtin_names() else []
    except UsageError:
        return []
