"""What each variable and each row of a program is, in words, in the order of its vectors."""

from collections.abc import Iterator

from hopopt.nlp.transcription import Rows, Transcription


def variable_names(t: Transcription) -> tuple[str, ...]:
    """Of every variable: its phase, component and node, such as "stance q[hip] 3"; durations, and free parameters."""
    return tuple(_variables(t))


def _variables(t: Transcription) -> Iterator[str]:
    for name, layout in t.layouts.items():
        for group, nodes in ((layout.phase.states, layout.state_nodes), (layout.phase.controls, layout.control_nodes)):
            parts = [str(c) for variable in group for c in variable.components()]
            yield from (f"{name} {part} {node}" for node in range(nodes) for part in parts)
        arcs = layout.mesh.arcs
        yield from (f"{name} duration{f' of arc {k + 1}' if arcs > 1 else ''}" for k in range(arcs))
    yield from (str(c) for parameter in t.free for c in parameter.components())


def row_names(t: Transcription) -> tuple[str, ...]:
    """Of every row: its phase, what it states, and where: "stance motion of q[hip] 3+0.645" is in interval 3, at 0.645 of it."""
    return tuple(name for rows in t.rows for name in _rows(rows))


def _rows(rows: Rows) -> Iterator[str]:
    phase = f"{rows.phase} " if rows.phase else ""
    phase += "motion of " if rows.kind == "defect" else ""
    if not len(rows.interval):
        yield from (f"{phase}{label}" for label in rows.labels)
    for k, place in zip(rows.interval, rows.place, strict=True):
        yield from (f"{phase}{label} {k}+{place:.4g}" for label in rows.labels)


def parameter_names(t: Transcription) -> tuple[str, ...]:
    """Of every fixed parameter: its entry of the problem."""
    return tuple(str(c) for parameter in t.fixed for c in parameter.components())
