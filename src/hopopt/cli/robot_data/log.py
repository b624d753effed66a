"""The command that sets a robot's hop beside the bound: log."""

from pathlib import Path

from hopopt.cli.options import AsJson, LogNames, ended, write_new
from hopopt.cli.screen.console import NamedLines
from hopopt.errors import UsageError
from hopopt.problem.load import load
from hopopt.report.motion import planned, simulated
from hopopt.report.page import Content, page
from hopopt.robot_data.robot_hop import account, sentences, trace_of
from hopopt.robot_data.robot_log import read_log, read_map
from hopopt.storage.solution import read


def log(
    run: Path,
    *,
    leg: str = "paper",
    bound: Path | None = None,
    map_: LogNames = None,
    report: Path | None = None,
    json_: AsJson = False,
) -> int:
    """Read a robot's hop from its log, and compare it with the optimum.

    Its clearance, its share of the bound, what it misses, and limits exceeded.

    Parameters
    ----------
    run
        A CSV file with a header: t, q_JOINT, v_JOINT and tau_JOINT of every joint, and contact or force_z. A unit may
        follow in brackets, as in q_knee [deg]. Or an MCAP file with JointState messages or JSON (docs/logs.md).
    leg
        The problem file of the leg, or the name of a built-in problem.
    bound
        A results folder of hopopt solve for the same leg, to compare with.
    map_
        A TOML file with the log's own names: q_hip = "hip_position".
    report
        Also write a page with the run beside the bound, such as run.html.
    """
    design, best = load(leg), read(bound) if bound else None
    if best is not None and (best.design.leg.joints != design.leg.joints or best.objective != "clearance"):
        raise UsageError(
            f"--bound {bound}: it is not the highest hop of a leg with the joints {', '.join(design.leg.joints)}"
        )
    if best is not None and not best.verified:
        raise UsageError(f"--bound {bound}: it is not verified, so it bounds nothing: hopopt verify says why")
    found = read_log(run, design, read_map(map_))
    data = {"log": str(run), "problem": design.name, **account(design, found, best)}
    first, *others = sentences(data)
    if report is not None:
        trace = trace_of(found, design)
        hops = [simulated(trace, run.name, data["clearance_m"]), *([planned(best, "the bound")] if best else [])]
        where = {"log": str(run), "bound": str(bound)}
        write_new(report, page(Content(design, hops, words=[first, *others], provenance=where)))
    return ended({**data, "exit_code": 0}, json_, [f"{run}: {first}", NamedLines("hop", others)])
