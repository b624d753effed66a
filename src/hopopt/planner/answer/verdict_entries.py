"""What a summary says of a verdict: whether it is verified, its checks, its error, its certificate and its structure."""

from dataclasses import asdict
from typing import Any

from hopopt.optimality.minimum_principle import switching_structure as structure
from hopopt.planner.answer.summary_extras import Stretch, Structure
from hopopt.planner.answer.summary_parts import Condition, Error, Estimate, NamedCheck, Relaxed, Simulated
from hopopt.planner.answer.verdict import StatedError, Verdict


def verification_entries(verdict: Verdict) -> dict[str, Any]:
    """Entries that say whether an answer is verified: in words, as the exit code, and check by check."""
    verified = verdict.verified
    return {
        "status": "verified" if verified else "solved, not verified",
        "verified": verified,
        "exit_code": 0 if verified else 3,
        "verification": tuple(NamedCheck(**c.as_dict()) for c in verdict.checks),
        "failed_checks": tuple(verdict.failed_checks),
    }


def conditions(verdict: Verdict) -> dict[str, Condition]:
    """Conditions of the certificate, by name."""
    entries = {c.name.replace(" ", "_"): c.as_dict() for c in verdict.conditions}
    return {name: Condition(**{k: v for k, v in entry.items() if k != "name"}) for name, entry in entries.items()}


def error_entry(error: StatedError) -> Error:
    """The stated error as a summary holds it."""
    reported = error.as_dict()
    return Error(
        **{k: reported[k] for k in ("too_high_by", "relative", "could_be_beaten_by")},
        estimate=Estimate(**reported["estimate"]),
        simulated=Simulated(**reported["simulated"]),
        relaxed=Relaxed(**reported["relaxed"]),
    )


def structure_entry(found: dict[str, list[structure.Stretch]]) -> Structure:
    """The switching structure as a summary holds it."""
    stretches: dict[str, Any] = {phase: tuple(Stretch(**asdict(s)) for s in parts) for phase, parts in found.items()}
    return Structure(words=tuple(structure.sentences(found)), **stretches)
