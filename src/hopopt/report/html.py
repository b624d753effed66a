"""What every page has in common: one HTML file with its style, the answer first, parameters and provenance last."""

from collections.abc import Mapping, Sequence
from importlib.metadata import version
from importlib.resources import files
from typing import Any

from jinja2 import Environment, FunctionLoader, StrictUndefined, UndefinedError
from markupsafe import Markup

from hopopt.design import Design
from hopopt.problem.render import rows, toml_value


def part(name: str) -> str:
    """A file of this package: a template, the style, or a script."""
    return files("hopopt.report").joinpath(name).read_text(encoding="utf-8")


def written(value: Any) -> str:
    """A value of a problem for a reader: as the file has it, but for digits of a number that rounding left, and quotes."""
    if value is None:
        return "not set"
    if isinstance(value, float):
        return f"{value:.12g}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(written, value))}]"
    return value if isinstance(value, str) else toml_value(value)


def render(
    template: str,
    design: Design,
    *,
    of: str,
    kind: str,
    answer: Sequence[str],
    provenance: Mapping[str, str],
    varied: Mapping[str, str] | None = None,
    **more: Any,
) -> str:
    """The HTML file that a template makes.

    design: the problem, whose entries stand at the end
    of: what the page is of, for its title
    kind: a line above the heading
    answer: the answer in plain words, first
    provenance: name -> text of where the result comes from
    varied: entry -> its values, of entries that are not as in the problem
    more: what this template needs besides

    Raises ValueError where that lacks something.
    """
    environment = Environment(loader=FunctionLoader(part), autoescape=True, undefined=StrictUndefined, trim_blocks=True)
    title = design.title or design.name
    try:
        return environment.get_template(template).render(
            version=version("hopopt"), style=Markup(part("page.css")), title=f"{title}: {of}", heading=title, kind=kind,
            answer=answer, rows=rows(design), written=written, varied=varied or {}, provenance=provenance, **more,
        )  # fmt: skip
    except UndefinedError as error:  # like any other fault of what was read
        raise ValueError(str(error)) from error
