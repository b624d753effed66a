"""Write docs/reference/: every public function and class of hopopt in Python, from signatures and docstrings.

    python docs/write_reference.py

Of a function its arguments and an example, which a test runs; of a class its fields, with shape and unit, and its methods.
"""

import dataclasses
import inspect
import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import hopopt as ho
from hopopt.control.setting import Setting
from hopopt.ocp.custom import Moment, Rates
from hopopt.planner.checks.smooth_plan import SmoothPlan
from hopopt.planner.checks.verdict import Verdict
from hopopt.planner.motion import Samples
from hopopt.robot_data.identification import Identification
from hopopt.sim.controller import Measurement
from hopopt.sim.hop_metrics import HopFigures
from hopopt.sim.trace import Event, Trace
from hopopt.studies.influence import Influence
from hopopt.studies.pareto.front import FrontPoint
from hopopt.studies.sweep.point_file import Point
from hopopt.verify.check import Check

HOME = Path(__file__).parent / "reference"
PAGES: dict[str, tuple[str, str, tuple[Any, ...]]] = {  # file -> title, first sentence, what stands on it
    "functions": ("Functions: one problem", "One hop, its program, and your own functions.", (
        ho.load, ho.solve, ho.program, ho.simulate, ho.identify, ho.objective, ho.constraint,
    )),
    "studies": ("Functions: many hops", "Studies of many hops.", (ho.sweep, ho.choose, ho.pareto, ho.robust, ho.transition)),
    "kept": ("Functions: what is kept", "Results written, read and verified.", (ho.save, ho.read, ho.verify)),
    "live": ("A live page", "A page on which numbers are dragged.", (ho.explore, ho.LivePage)),
    "hop": ("Classes: a hop", "What `ho.solve` returns.", (ho.Solution, Samples)),
    "checks": ("Classes: what is said of a hop", "Sensitivities, checks and smooth plans.", (Influence, ho.Verification, Verdict, Check, SmoothPlan)),
    "moment": ("Classes: problems and functions of your own", "What your own functions and controllers are given.", (
        ho.Design, Moment, Rates, Setting, Measurement,
    )),
    "program": ("Classes: the program", "The nonlinear program at hand.", (ho.Program, ho.ProgramSolution)),
    "runs": ("Classes: simulated runs", "What `ho.simulate` returns.", (ho.Run, Trace, Event, HopFigures)),
    "comparisons": ("Classes: controllers beside the optimum", "Comparisons, and why PD control is lower.", (
        ho.Comparison, ho.HopsComparison, ho.Ladder, Identification,
    )),
    "many": ("Classes: studies", "Studies of many hops.", (ho.Study, Point, ho.Map, ho.Choice)),
    "fronts": ("Classes: fronts, robust plans, transitions", "What other verbs of many hops return.", (
        ho.Front, FrontPoint, ho.RobustHop, ho.Transition,
    )),
}  # fmt: skip
EXAMPLES = {  # s is a solved hop of the paper's leg
    "load": 'leg = ho.load("paper", ["leg.gear.ratio=80"])\nprint(leg.leg.gear.ratio)',
    "solve": 's = ho.solve("paper", "clearance", starts=1, results="results")\nprint(s.clearance, s.verified, s.folder)',
    "program": 'program = ho.program("paper")\nprint(program.variable_names[0], program.lbx[0], program.ubx[0])',
    "simulate": 'run = ho.simulate("paper", "force")\nprint(run.figures.clearance, run.trace.t[-1])  # [m], [s]',
    "identify": 'found = ho.identify("paper", "log_1.csv", "log_2.csv")\nprint(found.as_dict()["parameters"])  # each with its interval',
    "objective": '@ho.objective(unit="m", scale=0.5)\ndef body_height(end):\n    return end.q[1]  # of the body, where the hop ends\n\n\ns = ho.solve("paper", body_height, starts=1)',
    "constraint": '@ho.constraint(upper=600.0, unit="N", scale=600.0, phases=("stance",))\ndef soft_ground(now):\n    return now.f[-1]\n\n\ns = ho.solve("paper", constraints=[soft_ground], starts=1)',
    "sweep": 'study = ho.sweep("paper", {"leg.gear.ratio": [80, 90, 100]}, starts=1, time_limit=300)\nprint(study.best.values, study.to_dataframe()["clearance_m"].max())',
    "explore": 'page = ho.explore("paper", entries=["leg.gear.ratio"], starts=1)\nprint(page.address)\npage.close()',
    "choose": 'choice = ho.choose("paper", 0.6, verify=2)\nprint(choice.candidates[:3])',
    "pareto": 'front = ho.pareto("paper", "peak_force", points=3, starts=1)\nprint(front.to_dataframe()[["clearance_m", "objective_value"]])',
    "robust": 'found = ho.robust(s, draws=60, evaluations=1)\nprint(found.to_dataframe().groupby("strategy")["clearance_m"].median())',
    "transition": 'way = ho.transition("paper", most=2, starts=1)\nprint(way.plan.clearances)  # [m] of each hop',
    "save": 'kept = ho.save(s, "results")\nprint(kept.folder)',
    "read": 'again = ho.read(ho.save(s, "results").folder)\nprint(again.clearance)',
    "verify": 'found = ho.verify(s)\nprint(found.verified, found.faults)',
}  # fmt: skip
FIELD = re.compile(r"^(\w+(?:, \w+)*): (.*)$")  # a line of a docstring that says what an argument or a field is


def pages() -> dict[str, str]:
    """Every page by its file's name."""
    lines = [
        "# Reference of the Python interface",
        "",
        "Written by `python docs/write_reference.py` from docstrings.",
        "",
    ]
    lines += ["```python", "import hopopt as ho", "```", ""]
    found = dict[str, str]()
    for name, (title, first, things) in PAGES.items():
        listed = ", ".join(f"`{_called(thing)}`" for thing in things)
        lines.append(f"- [{title}]({name}.md): {listed}")
        parts = [f"# {title}", "", f"{first} [All pages](index.md).", ""]
        for thing in things:
            parts += [*(_class(thing) if inspect.isclass(thing) else _function(thing)), ""]
        found[f"{name}.md"] = "\n".join(parts).rstrip("\n") + "\n"
    keys = "The figures of an answer, `s.summary` and `s.as_dict()`, are the keys of `summary.json`"
    lines += ["", f"{keys}: [glossary](../glossary.md#keys-of-summaryjson)."]
    return {"index.md": "\n".join(lines) + "\n", **found}


def _called(thing: Any) -> str:
    return f"ho.{thing.__name__}" if getattr(ho, thing.__name__, None) is thing else thing.__name__


def told(thing: Any) -> tuple[list[str], dict[str, str]]:
    """Of a docstring its paragraphs, and by argument or field what is said of it."""
    text, fields, last = list[str](), dict[str, str](), ""
    for line in (inspect.getdoc(thing) or "").splitlines():
        if match := FIELD.match(line):
            last, words = match[1], match[2]
            fields |= dict.fromkeys(last.split(", "), words)
        elif last and line.startswith("    "):
            fields |= {name: f"{fields[name]} {line.strip()}" for name in last.split(", ")}
        else:
            last = ""
            text.append(line)
    return [" ".join(p.split()) for p in "\n".join(text).split("\n\n") if p.strip()], fields


def _function(function: Any) -> Iterator[str]:
    paragraphs, fields = told(function)
    yield f"## {_called(function)}"
    for words in paragraphs[:1]:
        yield from ("", words)
    yield from ("", *_arguments(function, fields))
    for words in paragraphs[1:]:
        yield from ("", words)
    yield from ("", "```python", *EXAMPLES[function.__name__].splitlines(), "```")


def _arguments(function: Any, fields: dict[str, str]) -> Iterator[str]:
    """A line for each argument: its name, its default, and what it is."""
    for name, argument in inspect.signature(function).parameters.items():
        default = "" if argument.default is inspect.Parameter.empty else f" = {argument.default!r}"
        meaning = fields.get(name, "")
        yield f"- `{name}{default}`{f': {meaning}' if meaning else ''}"


def _class(kind: Any) -> Iterator[str]:
    paragraphs, _ = told(kind)
    yield f"## {_called(kind)}"
    for words in paragraphs:
        yield from ("", words)
    if rows := [*_fields(kind), *_properties(kind)]:
        yield from ("", "| field | what it is |", "|---|---|")
        yield from (f"| `{name}` | {meaning.replace('|', '/')} |" for name, meaning in rows)
    for name, method in _methods(kind):
        words, fields = told(method)
        listed = ", ".join(p for p in inspect.signature(method).parameters if p != "self")
        more = "; ".join(f"`{key}`: {meaning}" for key, meaning in fields.items())
        yield from ("", f"`{name}({listed})`: {' '.join(words)}{f' {more}' if more else ''}")


def _fields(kind: Any) -> Iterator[tuple[str, str]]:
    """Fields of a dataclass, or of a model, and what its docstring or that of a class before it says of them."""
    said = dict[str, str]()
    for base in reversed(kind.__mro__):
        said |= told(base)[1] if base.__doc__ else {}
    if dataclasses.is_dataclass(kind):
        for f in dataclasses.fields(kind):
            if not f.name.startswith("_"):
                yield f.name, said.get(f.name) or str(f.metadata.get("description", ""))
    for name, f in getattr(kind, "__pydantic_fields__", {}).items() if not dataclasses.is_dataclass(kind) else ():
        of_table = (inspect.getdoc(f.annotation) or "").partition("\n")[0] if inspect.isclass(f.annotation) else ""
        yield name, str(f.description or of_table)


def _properties(kind: Any) -> Iterator[tuple[str, str]]:
    for name, member in inspect.getmembers(kind):
        if not name.startswith("_") and _is_property(member) and (words := told(member)[0]):
            yield name, words[0]


def _is_property(member: Any) -> bool:
    return isinstance(member, property) or type(member).__name__ == "cached_property"


def _methods(kind: Any) -> Iterator[tuple[str, Any]]:
    """What hopopt itself adds; not what makes one class of another."""
    for name, member in inspect.getmembers(kind, inspect.isfunction):
        own = str(getattr(member, "__module__", "")).startswith("hopopt")
        if (
            own
            and not name.startswith("_")
            and name not in ("with_methods", "noted", "with_summary")
            and member.__doc__
        ):
            yield name, member


if __name__ == "__main__":
    HOME.mkdir(exist_ok=True)
    for name, text in pages().items():
        (HOME / name).write_text(text, encoding="utf-8")
        print(f"docs/reference/{name}: {len(text.split())} words")
