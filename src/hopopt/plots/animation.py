"""Hops as a moving picture: GIF, MP4, or an SVG that moves by itself; several hops overlaid in step."""

import os
import tempfile
from collections.abc import Sequence
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np
from matplotlib.animation import FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.figure import Figure

from hopopt.errors import ResultError, UsageError
from hopopt.plots.style import GREY, TEXT, describe, legend, new_figure
from hopopt.report.chart import LEFT, RIGHT, Chart, span
from hopopt.report.motion import ShownHop
from hopopt.report.page import COLORS
from hopopt.storage.folder import reason_of

PICTURE_RATE = 25  # pictures per second
HOLD = 1.0  # [s] that the last picture stands before it begins anew
HEIGHT, EDGES, DPI = (
    5.2,
    (1.0, 1.35),
    80,
)  # [in] of the picture; of it beside and over the axes; pixels to the inch: small enough to mail
NARROWEST = 4.5  # [in], for the title
PICTURE_HEIGHT = 420  # pixels of the SVG
SUFFIXES = (".gif", ".mp4", ".svg")


def animate(hops: Sequence[ShownHop], title: str, file: Path, slower: float = 4.0) -> None:
    """Write hops, one over the other, into a file whose suffix says the format; a second takes ``slower`` seconds.

    Raises UsageError for another suffix, a file that exists already, or an MP4 where there is no ffmpeg; ResultError if
    the file cannot be written. It is then not there at all.
    """
    _usable(file)
    work: Path | None = None
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=".writing-", suffix=file.suffix.lower(), dir=file.parent)
        os.close(handle)
        work = Path(name)
        _write(hops, title, work, slower)
        os.chmod(work, 0o644)  # mkstemp makes it private
        os.link(work, file)  # unlike a renaming, it overwrites nothing
    except OSError as error:
        if isinstance(error, FileExistsError) and os.path.lexists(file):
            raise UsageError(f"{file} exists already and is not overwritten: choose another name") from None
        raise ResultError(f"{file} cannot be written ({reason_of(error)}): choose another name or folder") from error
    finally:
        if work is not None:
            work.unlink(missing_ok=True)


def _usable(file: Path) -> None:
    if file.suffix.lower() not in SUFFIXES:
        raise UsageError(f"{file}: an animation is a .gif, .mp4 or .svg file: name it so")
    if file.exists():
        raise UsageError(f"{file} exists already and is not overwritten: choose another name")
    if file.suffix.lower() == ".mp4" and not FFMpegWriter.isAvailable():
        raise UsageError(
            f"{file}: an .mp4 file needs ffmpeg, which is not installed: install it, or write a .gif or .svg"
        )


def _write(hops: Sequence[ShownHop], title: str, work: Path, slower: float) -> None:
    if work.suffix == ".svg":
        work.write_text(moving_svg(hops, title, slower), encoding="utf-8")
        return
    writer = PillowWriter(fps=PICTURE_RATE) if work.suffix == ".gif" else FFMpegWriter(fps=PICTURE_RATE)
    _drawn(hops, title, slower).save(work, writer=writer, dpi=DPI)


def instants(hops: Sequence[ShownHop], slower: float) -> np.ndarray:
    """Times [s] of the pictures: even until the last hop ends, which then stands still for ``HOLD``."""
    end = max(float(h.t[-1]) for h in hops)
    moving = np.linspace(0.0, end, max(2, round(end * slower * PICTURE_RATE)))
    return np.append(moving, np.full(round(HOLD * PICTURE_RATE), end))


def poses(hop: ShownHop, times: np.ndarray) -> np.ndarray:
    """The chain (k, n + 1, 2) [m] at times [s]; beyond its end as it ends."""
    return _between(hop.t, hop.chain, times)


def _between(t: np.ndarray, values: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Values (k, ...) of instants t (k,) at other times [s]; beyond the last as there."""
    flat = values.reshape(len(t), -1)
    found = [np.interp(times, t, column) for column in flat.T]
    return np.reshape(np.array(found).T, (len(times), *values.shape[1:]))


def _bounds(hops: Sequence[ShownHop]) -> tuple[tuple[float, float], tuple[float, float]]:
    """What is shown of x and z [m]."""
    top = max(float(h.chain[..., 1].max()) for h in hops)
    return span(*(h.chain[..., 0] for h in hops), margin=0.1), (-0.05 * top, 1.1 * top)


def _label(hop: ShownHop) -> str:
    return hop.name if hop.clearance is None else f"{hop.name}: {hop.clearance:.3f} m"


def _drawn(hops: Sequence[ShownHop], title: str, slower: float) -> FuncAnimation:
    (x, y), times = _bounds(hops), instants(hops, slower)
    wide = (HEIGHT - EDGES[1]) * (x[1] - x[0]) / (y[1] - y[0]) + EDGES[0]  # so that the axes fill it
    figure: Figure = new_figure(title, (max(wide, NARROWEST), HEIGHT))
    ax = figure.subplots()
    ax.axhline(0, color=GREY, lw=3, zorder=1)
    ax.set(xlim=x, ylim=y, aspect="equal")
    describe(ax, "along [m]", "height [m]")
    clock = ax.set_title(" ", loc="right", fontsize=TEXT)  # over the axes: in them it would lie on a leg
    legs, chains, bars = [], [poses(hop, times) for hop in hops], [_between(hop.t, hop.bars, times) for hop in hops]
    ended = max(hops, key=lambda hop: hop.t[-1]).ends
    for hop, color in zip(hops, COLORS, strict=False):
        ax.plot(*hop.chain[:, -1].T, color=color, lw=1, alpha=0.5)
        (leg,) = ax.plot([], [], "-o", color=color, lw=4, ms=6, mfc="white", label=_label(hop))
        (body,) = ax.plot([], [], "o", color=color, ms=14)
        thin = [ax.plot([], [], "-o", color=color, lw=1.5, ms=3)[0] for _ in hop.bars[0]]
        legs.append((leg, body, thin))
    legend(figure)

    def draw(k: int) -> list:
        for (leg, body, thin), chain, beside in zip(legs, chains, bars, strict=True):
            leg.set_data(*chain[k].T)
            body.set_data(*chain[k, :1].T)
            for line, ends in zip(thin, beside[k], strict=True):
                line.set_data(*ends.T)
        clock.set_text(f"{times[k]:.3f} s{f', {ended}' if ended and times[k] == times[-1] else ''}")
        return [clock]

    return FuncAnimation(figure, draw, frames=len(times), interval=1000 / PICTURE_RATE)


def moving_svg(hops: Sequence[ShownHop], title: str, slower: float) -> str:
    """An SVG without a script: its legs move by SMIL, in a browser or a page that shows the file as a picture."""
    (x, y), times = _bounds(hops), instants(hops, slower)
    width = round(LEFT + RIGHT + (x[1] - x[0]) * (PICTURE_HEIGHT - 56) / (y[1] - y[0]))
    chart, last = Chart(x, y, width, PICTURE_HEIGHT, "along [m]", "height [m]"), len(times) / PICTURE_RATE
    left, right, _, bottom = chart.frame
    timing = f'dur="{last:.2f}s" repeatCount="indefinite"'
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {PICTURE_HEIGHT + 22 * len(hops)}" width="{width}" '
        f'font-family="sans-serif" font-size="13" role="img"><title>{escape(title)}</title>',
        '<rect width="100%" height="100%" fill="#fff"/>',
        *(f'<text x="{at:.1f}" y="{bottom + 16}" text-anchor="middle">{text}</text>' for at, text in chart.ticks("x")),
        *(f'<text x="{left - 6}" y="{at + 4:.1f}" text-anchor="end">{text}</text>' for at, text in chart.ticks("y")),
        f'<text x="{(left + right) / 2}" y="{PICTURE_HEIGHT - 8}" text-anchor="middle">{chart.x_label}</text>',
        f'<text transform="rotate(-90)" x="{-PICTURE_HEIGHT / 2}" y="14" text-anchor="middle">{chart.y_label}</text>',
        f'<path d="M{left} {chart.y_zero:.1f}H{right}" stroke="{GREY}" stroke-width="3"/>',
    ]
    for k, (hop, color) in enumerate(zip(hops, COLORS, strict=False)):
        shown = [chart.line(*chain.T) for chain in poses(hop, times)]
        cx, cy = zip(*(text.partition(" ")[0].split(",") for text in shown), strict=True)
        thin = [[chart.line(*ends.T) for ends in each] for each in _between(hop.t, hop.bars, times).swapaxes(0, 1)]
        places = (f'<animate attributeName="c{n}" values="{";".join(v)}" {timing}/>' for n, v in (("x", cx), ("y", cy)))
        row = PICTURE_HEIGHT + 22 * k + 10
        lines += [
            f'<polyline points="{chart.line(*hop.chain[:, -1].T)}" fill="none" stroke="{color}" opacity=".5"/>',
            *(
                f'<polyline points="{bar[0]}" fill="none" stroke="{color}" stroke-width="2">'
                f'<animate attributeName="points" values="{";".join(bar)}" {timing}/></polyline>'
                for bar in thin
            ),
            f'<polyline points="{shown[0]}" fill="none" stroke="{color}" stroke-width="6" stroke-linejoin="round">'
            f'<animate attributeName="points" values="{";".join(shown)}" {timing}/></polyline>',
            f'<circle cx="{cx[0]}" cy="{cy[0]}" r="10" fill="{color}">{"".join(places)}</circle>',
            f'<circle cx="{left + 6}" cy="{row - 4}" r="6" fill="{color}"/>',
            f'<text x="{left + 18}" y="{row}">{escape(_label(hop))}</text>',
        ]
    return "\n".join([*lines, "</svg>"]) + "\n"
