"""The exported tracker in C as a controller: compiled without a warning, and asked as the Python tracker is asked."""

import ctypes
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from hopopt.sim.controller import Measurement

COMPILER = shutil.which("gcc") or shutil.which("cc")
STRICT = (
    "-std=c99",
    "-O2",
    "-Wall",
    "-Wextra",
    "-Wpedantic",
    "-Wconversion",
    "-Wshadow",
    "-Werror",
    "-ffp-contract=off",
)
HARNESS = """#include "tracker.h"
static hopopt_tracker state;
void reset(void) { hopopt_reset(&state); }
void torque(double t, const double *q, const double *v, int contact, double since, int landings, double *tau) {
    hopopt_real angles[HOPOPT_JOINTS], speeds[HOPOPT_JOINTS], torques[HOPOPT_JOINTS];
    for (int j = 0; j < HOPOPT_JOINTS; j++) angles[j] = (hopopt_real)q[j], speeds[j] = (hopopt_real)v[j];
    hopopt_torque(&state, (hopopt_real)t, angles, speeds, contact, (hopopt_real)since, landings, torques);
    for (int j = 0; j < HOPOPT_JOINTS; j++) tau[j] = (double)torques[j];
}
void drives(const double *q, const double *tau, double *out) {
    hopopt_real angles[HOPOPT_JOINTS], torques[HOPOPT_JOINTS];
    for (int j = 0; j < HOPOPT_JOINTS; j++) angles[j] = (hopopt_real)q[j], torques[j] = (hopopt_real)tau[j];
    hopopt_drive_torques(angles, torques);
    for (int j = 0; j < HOPOPT_JOINTS; j++) out[j] = (double)torques[j];
}
"""
Doubles = ctypes.POINTER(ctypes.c_double)


@dataclass
class InC:
    """A controller that asks the compiled tracker."""

    compiled: ctypes.CDLL

    def __post_init__(self) -> None:
        double, whole = ctypes.c_double, ctypes.c_int
        self.compiled.torque.argtypes = [double, Doubles, Doubles, whole, double, whole, Doubles]
        self.compiled.torque.restype = None
        self.compiled.drives.argtypes = [Doubles, Doubles, Doubles]
        self.compiled.drives.restype = None
        self.compiled.reset()

    def torque(self, now: Measurement) -> np.ndarray:
        q, v, tau = np.ascontiguousarray(now.q), np.ascontiguousarray(now.v), np.zeros(len(now.q))
        arrays = [x.ctypes.data_as(Doubles) for x in (q, v, tau)]
        self.compiled.torque(now.t, *arrays[:2], int(now.contact), now.since, now.landings, arrays[2])
        return tau


def compiled(folder: Path, text: str, *words: str) -> Callable[[], InC]:
    """Makes fresh controllers of a header, compiled without a warning."""
    if COMPILER is None:
        pytest.skip("there is no C compiler (gcc or cc) on this machine")
    (folder / "tracker.h").write_text(text, encoding="utf-8")
    (folder / "harness.c").write_text(HARNESS, encoding="utf-8")
    command = [COMPILER, *STRICT, *words, "-shared", "-fPIC", "harness.c", "-o", "tracker.so", "-lm"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=60, check=False)
    assert done.returncode == 0, done.stderr
    return lambda: InC(ctypes.CDLL(str(folder / "tracker.so")))
