"""One leg of every legged robot in example-robot-data, from its file as it is to a verified hop.

    python benchmarks/public_legs.py [FOLDER] [SECONDS] [ROBOTS]

Reads each leg as its file has it, says what that lacks, adds the numbers below, and solves it: one start (three where that
leads to no hop), friction 0.7, the body shared by all legs, the solids that its file states for collisions, at most SECONDS
of wall time (60) each. Legs of humanoids are hip and knee, the ankle held. Robots are solved one after the other, each in a
process of its own, or only those named (separated by commas). What FOLDER (public_legs) has already is not solved again.
Prints a table with the processor time of each, its median, and beneath it what the files lack. The exit status is 1 if a
solved hop was not verified.
"""

import json
import resource
import subprocess
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import hopopt as ho
from hopopt.errors import HopoptError, ProblemFileError, one_line

FRICTION = 0.7
ODRI = 'motor = "odri-solo"\ngear = "odri-solo"'
Q = "example-robot-data"


@dataclass(frozen=True)
class Leg:
    """A robot's leg.

    file: of the robot, below example-robot-data
    joints: from the body to the foot
    foot, point: the foot's link, and the foot in its frame [m]
    legs: how many carry the body
    start: angles of the joints [rad]
    lacks: lines of the table [leg] for what the file lacks
    locked: joints that are held elsewhere than at 0, with their angles [rad]
    stance: the longest [s], where a longer one may wait in many equal ways; 0: by default
    """

    file: str
    joints: tuple[str, ...]
    foot: str
    legs: int
    start: tuple[float, ...]
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)
    lacks: str = ""
    locked: str = ""
    stance: float = 0.0

    def problem(self, name: str, lacks: str) -> str:
        """The text of its problem file, with lines for what the robot's file lacks."""
        locked = f"locked = {{{self.locked}}}\n" if self.locked else ""
        hop = f"[hop]\nstance_duration = [0.03, {self.stance}]\n" if self.stance else ""
        return (
            f'name = "{name}"\n[leg]\nurdf = "{Q}/{self.file}"\njoints = {json.dumps(self.joints)}\n'
            f'foot_frame = "{self.foot}"\nfoot_point = {list(self.point)}\ngeometry = true\n{locked}body.legs = {self.legs}\n{lacks}\n'
            f"[start]\njoint_angles = {list(self.start)}\n[contact]\nfriction = {FRICTION}\n{hop}"
        )


def ranges(joints: Sequence[str], *limits: tuple[float, float]) -> str:
    """Lines for limits of joints [rad]."""
    return "\n".join(f"{j} = {{lower = {low}, upper = {high}}}" for j, (low, high) in zip(joints, limits, strict=True))


FRONT, THIGH = ("FL_HFE", "FL_KFE"), ("FL_thigh_joint", "FL_calf_joint")
ANY, TALOS = ("LF_HFE", "LF_KFE"), ("leg_left_3_joint", "leg_left_4_joint")
G1 = ("left_hip_pitch_joint", "left_knee_joint")
FOLDS = (-1.4, 1.4), (-2.6, -0.2)
SPRAWL = (0.8, -1.6)
LEGS = {
    "a1": Leg("a1_description/urdf/a1.urdf", THIGH, "FL_foot", 4, SPRAWL),
    "alexander": Leg("alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf", ("LEFT_HIP_Y", "LEFT_KNEE_Y"),
                     "LEFT_FOOT", 2, (-0.553, 1.2), (0.1, 0.0, -0.06), locked="LEFT_ANKLE_Y = -0.4"),
    "anymal_b": Leg("anymal_b_simple_description/robots/anymal.urdf", ANY, "LF_FOOT", 4, (1.085, -1.5), lacks=ranges(ANY, (-0.6, 1.6), (-2.6, -0.2)), stance=0.25),
    "anymal_c": Leg("anymal_c_simple_description/urdf/anymal.urdf", ANY, "LF_FOOT", 4, (0.999, -1.5), lacks=ranges(ANY, (-0.6, 1.6), (-2.6, -0.2))),
    "b1": Leg("b1_description/urdf/b1.urdf", THIGH, "FL_foot", 4, SPRAWL),
    "bolt": Leg("bolt_description/robots/bolt.urdf", FRONT, "FL_FOOT", 2, SPRAWL, lacks=f"{ODRI}\n{ranges(FRONT, *FOLDS)}"),
    "cassie": Leg("cassie_description/robots/cassie_v2.sdf", ("hip", "knee"), "foot", 2, SPRAWL),
    "centauro": Leg("centauro_description/urdf/centauro.urdf", ("hip_pitch_1", "knee_pitch_1"), "wheel_1", 4, (-0.519, -1.2),
                    locked="ankle_pitch_1 = -0.6"),
    "g1": Leg("g1_description/urdf/g1_29dof_rev_1_0.urdf", G1, "left_ankle_roll_link", 2, (-0.387, 1.2), (0.12, 0.0, -0.03),
              locked="left_ankle_pitch_joint = -0.4"),
    "go1": Leg("go1_description/urdf/go1.urdf", THIGH, "FL_foot", 4, SPRAWL),
    "go2": Leg("go2_description/urdf/go2.urdf", THIGH, "FL_foot", 4, SPRAWL),
    "human": Leg("human_description/robots/human.urdf", ("left_hip_Z", "left_knee_Z"), "left_foot", 2, (0.6, 1.2)),
    "hyq": Leg("hyq_description/robots/hyq_no_sensors.urdf", ("lf_hfe_joint", "lf_kfe_joint"), "lf_foot", 4, SPRAWL),
    "icub": Leg("icub_description/robots/icub_reduced.urdf", ("l_hip_pitch", "l_knee"), "l_sole", 2, (0.415, -1.2), (0.1, 0.0, 0.0),
                locked="l_ankle_pitch = -0.4"),
    "laikago": Leg("laikago_description/urdf/laikago.urdf", THIGH, "FL_foot", 4, SPRAWL),
    "quadruped": Leg("quadruped_description/urdf/quadruped.urdf", FRONT, "FL_contact", 4, SPRAWL, lacks=f"{ODRI}\n{ranges(FRONT, *FOLDS)}"),
    "romeo": Leg("romeo_description/urdf/romeo.urdf", ("LHipPitch", "LKneePitch"), "l_sole", 2, (-0.43, 1.2), (0.1, 0.0, 0.0),
                 locked="LAnklePitch = -0.4"),
    "simple_humanoid": Leg("simple_humanoid_description/urdf/simple_humanoid_classical.urdf", ("RLEG_HIP_P", "RLEG_KNEE"), "r_ankle", 2, (-0.544, 1.2)),
    "solo8": Leg("solo_description/robots/solo.urdf", FRONT, "FL_FOOT", 4, SPRAWL, lacks=f"{ODRI}\n{ranges(FRONT, *FOLDS)}"),
    "solo12": Leg("solo_description/robots/solo12.urdf", FRONT, "FL_FOOT", 4, SPRAWL, lacks=f"{ODRI}\n{ranges(FRONT, *FOLDS)}"),
    "talos": Leg("talos_data/robots/talos_reduced.urdf", TALOS, "left_sole_link", 2, (-0.449, 1.2), (0.1, 0.0, 0.0),
                 locked="leg_left_5_joint = -0.4"),
}  # fmt: skip


def faults(leg: Leg, file: Path, lacks: str) -> list[str]:
    """What is wrong with a leg's problem, in sentences; the problem is written to a file."""
    file.write_text(leg.problem(file.stem, lacks), encoding="utf-8")
    try:
        ho.load(file)
    except ProblemFileError as error:
        return list(error.problems)
    return []


def hopopt(*words: str) -> subprocess.CompletedProcess[str]:
    """The command with these words, in a process of its own."""
    return subprocess.run([sys.executable, "-m", "hopopt", *words], capture_output=True, text=True, check=False)


def solved(file: Path, seconds: float) -> dict[str, Any]:
    """What ``hopopt solve`` answers in a process of its own, and the processor time that took with its children [s]."""
    words = ["solve", str(file), "--no-figures", "--json", "--time-limit", str(seconds), "--results", str(file.parent)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    ran = hopopt(*words, "--starts", "1")
    ran = hopopt(*words, "--starts", "3") if ran.returncode == 1 else ran
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    spent = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    answer = json.loads(ran.stdout) if ran.returncode in (0, 3) else {"fault": " ".join(ran.stderr.split())[-400:]}
    return {"processor_s": spent, **answer}


def answer(name: str, folder: Path, seconds: float) -> dict[str, Any]:
    """What came of a robot's leg, from an earlier run if there is one."""
    file, leg = folder / f"{name}.json", LEGS[name]
    if not file.exists():
        bare = faults(leg, folder / f"{name}.toml", "")
        left = faults(leg, folder / f"{name}.toml", leg.lacks) if bare and leg.lacks else bare
        found: dict[str, Any] = {"lacks": bare, **({} if left else solved(folder / f"{name}.toml", seconds))}
        made = file.with_suffix(".part")
        made.write_text(json.dumps(found), encoding="utf-8")
        made.replace(file)
    return json.loads(file.read_text(encoding="utf-8"))


def row(name: str, found: dict[str, Any]) -> str:
    """A line of the table."""
    joints, stated = len(LEGS[name].joints), "yes" if found["lacks"] and "verified" in found else ""
    if "verified" not in found:
        return f"| {name} | {joints} | {stated} | {'not solved' if 'fault' in found else 'refused'} | | | | |"
    pd, near = (found.get("paper_strategy") or {}).get("clearance_m"), found.get("collision") or {}
    cells = [
        name, str(joints), stated, "yes" if found["verified"] else "NO", f"{found['clearance_m']:.4f}" if found["verified"] else "",
        "" if pd is None else f"{pd:.3f}", f"{found['processor_s']:.0f}",
        f"{1000 * near['least_distance_m']:.1f}" if near else "",
    ]  # fmt: skip
    return f"| {' | '.join(cells)} |"


def words(found: dict[str, dict[str, Any]]) -> Iterator[str]:
    """What each file lacks, or why its leg is not solved."""
    for name, one in found.items():
        failed = (
            [f"Not verified: {', '.join(one['failed_checks'])}.", *one["notes"]] if one.get("verified") is False else []
        )
        if said := [*one["lacks"], *([one["fault"]] if "fault" in one else []), *failed]:
            yield f"- {name}: {' '.join(said)}"


def main() -> int:
    """Solve, and print."""
    given = sys.argv[1:]
    folder, seconds = Path(given[0] if given else "public_legs"), float(given[1]) if len(given) > 1 else 60.0
    folder.mkdir(parents=True, exist_ok=True)
    found = dict[str, dict[str, Any]]()
    print(
        "| robot | joints | numbers added | verified | clearance [m] | PD [m] | processor time [s] | least distance [mm] |"
    )
    print("|---|---|---|---|---|---|---|---|")
    for name in given[2].split(",") if len(given) > 2 else LEGS:
        try:
            found[name] = answer(name, folder, seconds)
        except HopoptError as error:
            found[name] = {"lacks": [one_line(error)]}
        print(row(name, found[name]), flush=True)
    spent = [one["processor_s"] for one in found.values() if one.get("verified")]
    print(f"\n{len(spent)} verified" + (f", median of the processor times {median(spent):.0f} s" if spent else ""))
    print("", *words(found), sep="\n")
    return int(any(one.get("verified") is False for one in found.values()))


if __name__ == "__main__":
    sys.exit(main())
