"""Which versions of Python and of other packages hopopt is for: from which on it works, up to which it is tested.

Where it begins, pyproject.toml says; so it does of Python where it ends, by its classifiers.
"""

import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, metadata, version

from packaging.requirements import Requirement
from packaging.version import Version

TESTED = {  # the newest of each that all tests have passed with, on the newest Python that has it
    "casadi": "3.8.2", "cyclopts": "5.5.2", "h5netcdf": "1.8.2", "jinja2": "3.1.6", "joblib": "1.6.0", "matplotlib": "3.11.2",
    "numba": "0.68.1", "numpy": "2.5.5", "packaging": "26.4", "pin": "4.1.0", "pydantic": "2.14.4", "rich": "14.3.4",
    "scipy": "1.18.1", "typing-extensions": "4.16.0", "xarray": "2026.9.0",
    "dask": "2026.8.0", "distributed": "2026.8.0", "example-robot-data": "6.0.0", "mcap": "1.6.0", "mcap-ros2-support": "0.6.0",
    "mujoco": "4.0.0", "pycollada": "0.9.3", "tornado": "6.6.1", "viser": "1.1.1",
}  # fmt: skip
PYTHON = "Programming Language :: Python :: "


@cache
def lowest(name: str) -> str | None:
    """The first version of a package, or of "python", that this installation of hopopt says it works with."""
    said = metadata("hopopt")
    needs = [Requirement(line) for line in said.get_all("Requires-Dist") or []]
    needs += [Requirement(f"python{bounds}") for bounds in said.get_all("Requires-Python") or []]
    bounds = [Version(s.version) for need in needs if need.name == name for s in need.specifier if s.operator == ">="]
    return str(max(bounds)) if bounds else None


@cache
def newest_tested(name: str) -> str | None:
    """The last version of a package, or of "python", that hopopt is tested with."""
    if name != "python":
        return TESTED.get(name)
    said = [
        line.removeprefix(PYTHON) for line in metadata("hopopt").get_all("Classifier") or [] if line.startswith(PYTHON)
    ]
    return max(said, key=Version, default=None)


def installed(name: str) -> str | None:
    """The version of a package, or of "python", that is here."""
    try:
        return platform.python_version() if name == "python" else version(name)
    except PackageNotFoundError:
        return None


def too_old(name: str, found: str) -> str:
    """In words, if a version is older than what hopopt works with; else empty."""
    first = lowest(name)
    return f"older than {first}, the first that hopopt works with" if first and Version(found) < Version(first) else ""


def not_tested(name: str, found: str) -> str:
    """In words, if a version is newer than what hopopt is tested with; else empty."""
    last = newest_tested(name)
    if last is None or Version(found).release[: len(Version(last).release)] <= Version(last).release:
        return ""
    return f"newer than {last}, the last that hopopt is tested with"
