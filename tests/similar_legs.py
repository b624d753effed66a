"""The paper's leg in other sizes: whatever it does, copies do in the same gravity, in times of the root of their size."""

from dataclasses import replace

from hopopt.control.reference import PhaseReference, PlanReference

POWERS = {"m": 1.0, "s": 0.5, "N": 3.0, "N m": 4.0, "J": 4.0, "1": 0.0}  # of the size, by unit


def similar(size: float) -> dict[str, object]:
    """Entries of the paper's leg so many times as large: lengths by the size, masses by its cube, times by its root."""
    time = size**0.5
    lengths = {"leg.thigh.length": 0.38, "leg.shank.length": 0.361, "start.hip_height": 0.28, "hop.foot_window": 0.1}
    masses = {"leg.body.mass": 5.6, "leg.thigh.mass": 1.87, "leg.shank.mass": 0.8}
    return {
        **{name: size * length for name, length in lengths.items()},
        **{name: size**3 * mass for name, mass in masses.items()},
        "leg.motor.max_torque": 2.0 * size**4,
        "leg.motor.max_speed": 1256.637 / time,
        "leg.motor.rotor_inertia": 1.19e-5 * size**5,
        "hop.stance_duration": [0.03 * time, 0.4 * time],
        "hop.flight_duration": [0.03 * time, time],
        "simulation.control_rate": 4000.0 / time,
    }


def similar_plan(plan: PlanReference, size: float) -> PlanReference:
    """A plan of the paper's leg for one so many times as large."""
    time = size**0.5

    def phase(p: PhaseReference) -> PhaseReference:
        return PhaseReference(p.places, p.t * time, p.q, p.v / time, p.tau * size**4)

    return replace(
        plan,
        stance=phase(plan.stance),
        flight=phase(plan.flight),
        clearance=plan.clearance * size,
        apex=plan.apex * time,
    )
