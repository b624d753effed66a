"""Multipliers of an earlier mesh, carried to a new one: where to begin when only the mesh has changed.

The multipliers of the defects are the costate at the abscissae (times the quadrature weights), those of limits are
densities in time times the weights of their nodes: both are functions of time, and are sampled at the new nodes.
(Betts, Practical Methods for Optimal Control, 4.11: adjoint estimates from the multipliers.)
"""

from collections.abc import Iterator

import numpy as np

from hopopt.nlp.layout import PhaseLayout
from hopopt.nlp.solver.ipopt import NlpSolution
from hopopt.nlp.transcription import Rows, Transcription


def carried(old: NlpSolution, t: Transcription) -> tuple[np.ndarray, np.ndarray]:
    """lam_g and lam_x for program ``t``, of the same problem and scheme, from a solution on another mesh."""
    edges = {name: _edges(old, name, t) for name in old.phases}
    lam_g, lam_x = np.zeros(len(t.lbg)), np.zeros(len(t.scale))
    lam_x[t.parameters] = old.lam_x[old.transcription.parameters]
    for before, now in _same_rows(old.transcription, t):
        lam = old.lam_g[before.start : before.stop]
        if now.phase and now.kind != "duration":
            a, b = old.transcription.layouts[now.phase], t.layouts[now.phase]
            move = _costates if now.kind == "defect" else _densities
            lam = move(a, b, edges[now.phase], lam.reshape(a.mesh.intervals, -1, len(now.labels)))
        lam_g[now.start : now.stop] = lam.ravel()
    for name, layout in t.layouts.items():
        a, before, now = old.transcription.layouts[name], old.transcription.variables[name], t.variables[name]
        if a.mesh.arcs == layout.mesh.arcs:
            lam_x[now.durations] = old.lam_x[before.durations]
        u = old.lam_x[before.u].reshape(*a.controls_of.shape, -1)
        lam_x[now.u] = _densities(a, layout, edges[name], u).ravel() if u.size else []
        x = old.lam_x[before.x].reshape(a.state_nodes, -1)
        inner = _densities(a, layout, edges[name], x[1:].reshape(a.mesh.intervals, a.scheme.steps, -1))
        inner = inner.reshape(-1, x.shape[1])
        inner[-1] = x[-1]
        lam_x[now.x] = np.concatenate([x[:1], inner]).ravel()
    return lam_g, lam_x


def _same_rows(old: Transcription, t: Transcription) -> Iterator[tuple[Rows, Rows]]:
    """Rows of both programs: of a phase that has several arcs in one alone its duration is a row there alone."""
    arcs = [{name for name, mesh in each.mesh.items() if mesh.arcs > 1} for each in (old, t)]
    alone = arcs[0] ^ arcs[1]
    both = ([r for r in each.rows if r.kind != "duration" or r.phase not in alone] for each in (old, t))
    return zip(*both, strict=True)


def _edges(old: NlpSolution, phase: str, t: Transcription) -> np.ndarray:
    """Those of a phase's intervals as shares of it, (N + 1,): where free ones have come to, unless they begin again on the same
    mesh."""
    mesh = old.transcription.mesh[phase]
    moved = mesh.free and mesh != t.mesh[phase]
    return old.phases[phase].normalised_edges if moved else np.array(mesh.edges)


def _costates(a: PhaseLayout, b: PhaseLayout, edges: np.ndarray, lam: np.ndarray) -> np.ndarray:
    """Multipliers of the defects, (N, steps, nx), from those on mesh a with its edges where they are."""
    s = a.scheme
    costate = np.einsum("ikx,kj->ijx", lam, s.A) / s.b[:, None]
    interval, place = _located(edges, b, np.array(s.c))
    weights = s.control_weights(place.ravel()).reshape(*place.shape, -1)
    sampled = np.einsum("ikj,ikjx->ikx", weights, costate[interval])
    return np.einsum("kj,ijx->ikx", np.linalg.pinv(s.A.T), sampled * s.b[:, None])


def _densities(a: PhaseLayout, b: PhaseLayout, edges: np.ndarray, lam: np.ndarray) -> np.ndarray:
    """Multipliers of limits, (N, nodes, components): the nearest node's, by the share in its interval's length."""
    s, nodes = a.scheme, lam.shape[1]
    normalised_times = np.array(s.control_c if nodes == len(s.control_c) else s.c[-nodes:])
    weight = np.interp(normalised_times, s.c, s.b)
    old, new = (np.diff(at)[:, None, None] * weight[:, None] for at in (edges, b.mesh.edges))
    interval, place = _located(edges, b, normalised_times)
    nearest = np.abs(place[..., None] - normalised_times).argmin(axis=-1)
    return (lam / old)[interval, nearest] * new


def _located(edges: np.ndarray, b: PhaseLayout, normalised_times: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Interval between ``edges`` and place in it of all normalised times of every interval of mesh b, (N, times) each."""
    new = np.array(b.mesh.edges)
    middle = 0.5 * (new[1:] + new[:-1])
    interval = np.clip(np.searchsorted(edges, middle, side="right") - 1, 0, len(edges) - 2)[:, None]
    at = new[:-1, None] + np.diff(new)[:, None] * normalised_times
    place = (at - edges[interval]) / (edges[interval + 1] - edges[interval])
    return np.broadcast_to(interval, at.shape), np.clip(place, 0.0, 1.0)
