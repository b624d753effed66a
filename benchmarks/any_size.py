"""Whether the tracker follows its plan on legs of any size, with any encoder, at any rate.

    python benchmarks/any_size.py [FOLDER] [SECONDS] [LEGS]

On every leg, or those named (separated by commas), ``track`` hops with encoders of 8 to 18 bits and perfect ones, at 1 to
8 kHz. Prints a table for each leg: the share of the bound in percent, and in brackets by how much of stall torque feedback
moves the command from one sample to the next, at most. Bounds and plans are solved once and kept in FOLDER (any_size). No
leg is begun after SECONDS (1800); what is left out is said. The exit status is 1 if a hop stays below 90 % of the bound.
"""

import sys
import time
from pathlib import Path

import hopopt as ho
from hopopt.comparison.compare import reference_of
from hopopt.control.closed_loop import simulate
from hopopt.control.reference import PlanReference
from hopopt.control.strategies import find
from hopopt.design import Design
from hopopt.planner.reserve import plan_to_track
from hopopt.planner.solution import Solution
from hopopt.problem.load import builtin_names, changed
from hopopt.storage.solution import read, save

BITS, RATES = (8, 10, 12, 14, 18, 0), (1000, 2000, 4000, 8000)  # 0 bits: perfect
LEAST = 0.9  # of the bound
SMALL = {  # a leg of 2.55 kg
    "name": "small", "title": "A small leg", "leg.thigh.length": 0.18, "leg.thigh.mass": 0.6, "leg.shank.length": 0.17, "leg.shank.mass": 0.15, "leg.body.mass": 1.8,
    "leg.motor.max_torque": 1.5, "leg.motor.max_speed": 264.0, "leg.motor.rotor_inertia": 2.4e-5, "leg.gear.ratio": 6.0,
    "leg.hip.lower": -1.0, "leg.hip.upper": 1.5, "leg.knee.lower": -2.4, "leg.knee.upper": -0.2, "start.hip_height": 0.22,
}  # fmt: skip
ODRI = 'motor = "odri-solo"\ngear = "odri-solo"'
ROBOT = """
name = "{0}"
[leg]
urdf = "example-robot-data/{1}"
joints = ["{2}", "{3}"]
foot_frame = "{4}"
{5}
[leg.body]
mass = {6}
[leg.{2}]
lower = {7}
upper = {8}
[leg.{3}]
lower = {9}
upper = {10}
[start]
hip_height = {11}
[hop]
foot_window = {12}
"""
ROBOTS = (  # name, URDF, joints, foot, drive, mass of the body [kg], limits of the joints [rad], start, window [m]
    ("laikago", "laikago_description/urdf/laikago.urdf", "FL_thigh_joint", "FL_calf_joint", "FL_foot", "",
     4.53, -0.5, 1.6, -2.6, -0.62, 0.27, 0.07),
    ("bolt", "bolt_description/robots/bolt.urdf", "FL_HFE", "FL_KFE", "FL_FOOT", ODRI,
     0.447, -1.4, 1.4, -2.6, -0.2, 0.2, 0.05),
    ("anymal", "anymal_b_simple_description/robots/anymal.urdf", "LF_HFE", "LF_KFE", "LF_FOOT", "",
     5.64, -0.6, 1.3, -2.4, -0.15, 0.35, 0.08),
    ("solo8", "solo_description/robots/solo.urdf", "FL_HFE", "FL_KFE", "FL_FOOT", ODRI,
     0.357, -1.4, 1.4, -2.6, -0.2, 0.17, 0.05),
    ("alexander", "alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf", "LEFT_HIP_Y", "LEFT_KNEE_Y", "LEFT_FOOT", "",
     10.0, -1.3, 0.6, 0.15, 2.4, 0.5, 0.1),
)  # fmt: skip


def legs(folder: Path) -> dict[str, Design]:
    """Built-in legs, the small one, and public robots, whose problem files are written to a folder."""
    found = {"small": ho.load("paper", SMALL), **{name: ho.load(name) for name in builtin_names()}}
    for robot in ROBOTS:
        file = folder / f"{robot[0]}.toml"
        file.write_text(ROBOT.format(*robot))
        found[robot[0]] = ho.load(file)
    return found


def kept(folder: Path, solve: str, design: Design) -> Solution:
    """A bound or a plan, from an earlier run if there is one."""
    there = next(iter(folder.glob("*/solution.nc")), None)
    if there is not None:
        return read(there.parent)
    found = ho.solve(design, objective="clearance") if solve == "bound" else plan_to_track(design, lambda text: None)
    save(found, folder)
    return found


def case(design: Design, bits: int, rate: int, plan: PlanReference) -> tuple[float, float]:
    """Clearance [m] with such encoders at such a rate, and the largest move of feedback between samples [share of stall]."""
    here = changed(design, {"simulation.encoder_bits": bits, "simulation.control_rate": float(rate)})
    run = simulate(here, find("track"), plan=plan, past_apex=True)
    return run.figures.clearance, run.moves or 0.0


def table(name: str, bound: Solution, plan: Solution) -> float:
    """Print the cases of a leg; the lowest share of the bound."""
    print(f"{name}: bound {bound.clearance:.4f} m, plan {plan.clearance / bound.clearance:.1%} of it")
    print("   kHz  " + "".join(f"{f'{bits} bits' if bits else 'perfect':>14}" for bits in BITS))
    lowest, reference = 1.0, reference_of(plan)
    for rate in RATES:
        found = [case(bound.design, bits, rate, reference) for bits in BITS]
        shares = [clearance / bound.clearance for clearance, _ in found]
        cells = [f"{100 * s:8.1f} ({100 * moves:3.1f})" for s, (_, moves) in zip(shares, found, strict=True)]
        print(f"{rate / 1000:6.0f}  " + "".join(cells), flush=True)
        lowest = min(lowest, *shares)
    return lowest


def main() -> int:
    """Solve, simulate, print."""
    began, given = time.perf_counter(), sys.argv[1:]
    folder, seconds = Path(given[0] if given else "any_size"), float(given[1]) if len(given) > 1 else 1800.0
    folder.mkdir(parents=True, exist_ok=True)
    found = legs(folder)
    names, lowest = given[2].split(",") if len(given) > 2 else list(found), dict[str, float]()
    for name in names:
        if time.perf_counter() - began > seconds:
            break
        bound, plan = (kept(folder / name / what, what, found[name]) for what in ("bound", "plan"))
        lowest[name] = table(name, bound, plan)
    low = [f"{name} {share:.1%}" for name, share in lowest.items() if share < LEAST]
    print(f"below {LEAST:.0%} of the bound somewhere: {', '.join(low) or 'none'} of {len(lowest)} legs")
    if left := [name for name in names if name not in lowest]:
        print(f"left out for want of time: {', '.join(left)}")
    return 1 if low else 0


if __name__ == "__main__":
    sys.exit(main())
