"""Draw docs/images/packages.svg: which package of hopopt imports which, as the source stands.

    python docs/draw_packages.py

A package lies above all that it imports. An arrow is left out where other arrows lead to the same package.
"""

import ast
from collections.abc import Iterator, Mapping
from graphlib import TopologicalSorter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
SOURCE = ROOT / "src" / "hopopt"
PICTURE = ROOT / "docs" / "images" / "packages.svg"
WORDS = {  # what a package holds, as its box says
    "errors": "messages for a user",
    "files": "written whole or not at all",
    "fields": "entries of a table",
    "record": "figures with their units",
    "user_code": "module:function",
    "design": "every key of a problem file",
    "amounts": "what fits a computer",
    "compiled": "loops as machine code",
    "drivetrain": "command to joint torque",
    "leg": "the machine",
    "problem": "TOML to a checked design",
    "ocp": "the question, at instants",
    "sim": "the plant",
    "nlp": "mesh, transcription, Ipopt",
    "control": "strategies, closed loop",
    "verify": "checks by other code",
    "global_search": "dynamic programming",
    "optimality": "certificate, error, conflicts",
    "planner": "a problem to a verdict",
    "storage": "result folders",
    "studies": "how the optimum answers",
    "comparison": "controllers beside it",
    "evidence": "is it the best hop?",
    "robot_data": "logs, identification",
    "paper": "its figures, calibration",
    "export": "plans for robots",
    "report": "a page of results",
    "plots": "figures",
    "cli": "commands and screen",
    "api": "the verbs in Python",
}
FACES = ("__init__", "__main__")  # they only pass on what api and cli hold
WIDTH, BOX_WIDTH, BOX_HEIGHT, STEP, MARGIN, GAP, PASSING = 900, 182, 44, 82, 14, 24, 44  # all in pixels
SWEEPS = 4  # down and up the rows, to put what belongs together above each other

Graph = dict[str, set[str]]
Item = tuple[str, ...]  # a box by its package; a place where an arrow passes a row, by both its ends and the row


def imported(tree: ast.AST) -> Iterator[str]:
    """Dotted names that a module imports anywhere in it."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def packages() -> Graph:
    """Each package, or module of hopopt itself, and the others that it imports."""
    graph: Graph = {}
    for path in sorted(SOURCE.rglob("*.py")):
        package = path.relative_to(SOURCE).with_suffix("").parts[0]
        names = imported(ast.parse(path.read_text(encoding="utf-8")))
        found = {name.split(".")[1] for name in names if name.startswith("hopopt.")}
        graph.setdefault(package, set()).update(found - {package})
    kept = graph.keys() - set(FACES)
    return {package: graph[package] & kept for package in graph if package in kept}


def levels(graph: Mapping[str, set[str]]) -> dict[str, int]:
    """Height of each package: one more than that of the highest package below it."""
    height: dict[str, int] = {}
    for package in TopologicalSorter(graph).static_order():
        height[package] = max((height[below] + 1 for below in graph[package]), default=0)
    return height


def arrows(graph: Mapping[str, set[str]]) -> list[tuple[str, str]]:
    """From a package to those below it that no other arrow leads to."""
    below: Graph = {}
    for package in TopologicalSorter(graph).static_order():
        below[package] = graph[package].union(*(below[other] for other in graph[package]))
    return [
        (package, other)
        for package in sorted(graph)
        for other in sorted(graph[package])
        if not any(other in below[between] for between in graph[package] - {other})
    ]


def rows(graph: Mapping[str, set[str]]) -> tuple[list[list[Item]], dict[Item, list[Item]]]:
    """What stands in each row, the lowest first, and what lies below each of it: boxes, and the places where an arrow
    passes a row on its way to a lower one."""
    height = levels(graph)
    found: list[list[Item]] = [sorted((p,) for p in height if height[p] == h) for h in range(max(height.values()) + 1)]
    below: dict[Item, list[Item]] = {(p,): [] for p in height}
    for above, package in arrows(graph):
        item: Item = (package,)
        for level in range(height[package] + 1, height[above]):
            passing = (above, package, str(level))
            found[level].append(passing)
            below[passing], item = [item], passing
        below[above,].append(item)
    return found, below


def places(graph: Mapping[str, set[str]]) -> dict[Item, tuple[float, float]]:
    """Middle of each box and of each place where an arrow passes a row [pixels]."""
    found, below = rows(graph)
    above = {item: [other for other in below if item in below[other]] for item in below}
    order = {item: float(k) for row in found for k, item in enumerate(row)}
    for _ in range(SWEEPS):
        for side, sweep in ((below, found), (above, found[::-1])):
            for row in sweep:
                middle = {i: sum(order[o] for o in side[i]) / len(side[i]) if side[i] else order[i] for i in row}
                row.sort(key=lambda i: (middle[i], i))
                order |= {item: k - (len(row) - 1) / 2 for k, item in enumerate(row)}
    at: dict[Item, tuple[float, float]] = {}
    for level, row in enumerate(found):
        y = MARGIN + BOX_HEIGHT / 2 + STEP * (len(found) - 1 - level)
        x = (WIDTH - sum(_width(item) for item in row)) / 2
        for item in row:
            at[item] = (x + _width(item) / 2, y)
            x += _width(item)
    return at


def _width(item: Item) -> float:
    """Room that a box takes in its row, or an arrow that passes [pixels]."""
    return BOX_WIDTH + GAP if len(item) == 1 else PASSING


def drawn() -> str:
    """The picture as SVG."""
    graph = packages()
    at, height, tall = places(graph), levels(graph), STEP * max(levels(graph).values()) + BOX_HEIGHT + 2 * MARGIN
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {tall}" font-family="sans-serif" '
        'text-anchor="middle">',
        '<defs><marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0 0 L8 4 L0 8 z" fill="#666"/></marker></defs>',
        f'<rect width="{WIDTH}" height="{tall}" fill="#fff"/>',
    ]
    for above, below in arrows(graph):
        passed = [at[above, below, str(level)] for level in range(height[above] - 1, height[below], -1)]
        parts.append(_arrow(at[above,], passed, at[below,]))
    parts += [_box(package, *at[package,]) for package in sorted(graph)]
    return "\n".join([*parts, "</svg>", ""])


def _arrow(above: tuple[float, float], passed: list[tuple[float, float]], below: tuple[float, float]) -> str:
    """A curve from the lower edge of one box to the upper edge of another, straight down where it passes a row."""
    half = BOX_HEIGHT / 2
    path, (x, y) = f"M{above[0]:.1f} {above[1] + half:.1f}", (above[0], above[1] + half)
    for k, (to, middle) in enumerate([*passed, below]):
        top, bend = middle - half, (middle - half - y) / 2
        path += f" C{x:.1f} {y + bend:.1f} {to:.1f} {top - bend:.1f} {to:.1f} {top:.1f}"
        x, y = to, top
        if k < len(passed):
            y = middle + half
            path += f" V{y:.1f}"
    return f'<path d="{path}" fill="none" stroke="#666" stroke-width="1.3" marker-end="url(#tip)"/>'


def _box(package: str, x: float, y: float) -> str:
    left, top = x - BOX_WIDTH / 2, y - BOX_HEIGHT / 2
    return (
        f'<rect x="{left:.1f}" y="{top:.1f}" width="{BOX_WIDTH}" height="{BOX_HEIGHT}" rx="6" fill="#e8f1fa" '
        'stroke="#0072b2"/>'
        f'<text x="{x:.1f}" y="{y - 4:.1f}" font-size="15" font-weight="bold">{package}</text>'
        f'<text x="{x:.1f}" y="{y + 13:.1f}" font-size="11">{WORDS.get(package, "")}</text>'
    )


if __name__ == "__main__":
    PICTURE.parent.mkdir(exist_ok=True)
    PICTURE.write_text(drawn(), encoding="utf-8")
    print(f"{PICTURE.relative_to(ROOT)}: {len(packages())} packages")
