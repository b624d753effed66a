"""Files written whole or not at all, what killed processes left of them, and regular files read without waiting.

The one library for this, atomicwrites, is given up by its author, and leaves behind what a killed process was writing.
"""

import os
import platform
import re
import stat
from contextlib import suppress
from pathlib import Path
from shutil import rmtree

UNFINISHED_NAME = re.compile(r"\.(\d+)@(.+)$")  # how a name ends while it is written: its process and computer


def mark() -> str:
    """How the name of what this process is writing ends."""
    return f".{os.getpid()}@{platform.node()}"


def write_whole(path: Path, data: bytes) -> None:
    """A file that is there whole or not at all, whenever the process is killed or the disk is full; OSError if it is not."""
    temporary = path.with_name(f".{path.name[:100]}{mark()}")
    try:
        with temporary.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except BaseException:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
        raise


def remove_abandoned(folder: Path) -> None:
    """Remove what processes of this computer that have ended were still writing in a folder."""
    for path in folder.glob(".*@*"):
        found = UNFINISHED_NAME.search(path.name)
        if found and found[2] == platform.node() and not _alive(int(found[1])):
            with suppress(OSError):
                rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink(missing_ok=True)


def _alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except (ProcessLookupError, OverflowError):
        return False
    except PermissionError:  # somebody else's
        return True
    return True


def read_regular(path: Path, most: int) -> bytes:
    """A file's first ``most`` bytes; OSError, without waiting, if it is a pipe, a device or anything else but a file."""
    descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0))
    with open(descriptor, "rb") as file:
        if not stat.S_ISREG(os.fstat(descriptor).st_mode):
            raise OSError(0, "it is a pipe, a device or a folder, not a file")
        return file.read(most)
