"""Draw docs/images/between_nodes.svg: python docs/draw_between_nodes.py

A control of degree 2 that switches inside an interval: it violates its limit between the nodes. With its Bernstein
coefficients below the limit it does not.
"""

from pathlib import Path

import matplotlib as mpl
import numpy as np

mpl.use("svg")
from matplotlib import pyplot as plt

PICTURE = Path(__file__).parent / "images" / "between_nodes.svg"
NODES = np.array([0.155051, 0.644949, 1.0])  # flipped Radau points of an interval
TO_VALUES = np.column_stack([(1 - NODES) ** 2, 2 * NODES * (1 - NODES), NODES**2])  # of Bernstein coefficients
AT_NODES = np.array([0.0, 1.0, 1.0])  # all values within the limit, 1
LIMITED = np.array([-0.55, 0.94, 1.0])  # coefficients within it


def draw() -> None:
    """Two pictures side by side: the same switch, by its values at the nodes and by its coefficients."""
    figure, axes = plt.subplots(1, 2, figsize=(7.2, 2.4), sharey=True, layout="constrained")
    s = np.linspace(0, 1, 201)
    for axis, coefficients in zip(axes, (np.linalg.solve(TO_VALUES, AT_NODES), LIMITED), strict=True):
        y = np.column_stack([(1 - s) ** 2, 2 * s * (1 - s), s**2]) @ coefficients
        axis.axhline(1.0, color="0.4", linewidth=1)
        axis.fill_between(s, 1.0, y, where=y > 1.0, color="C3", alpha=0.4)
        axis.plot(s, y, "C0", label="torque")
        axis.plot(NODES, TO_VALUES @ coefficients, "C0o", markersize=4, label="values at the nodes")
        axis.plot([0, 0.5, 1], coefficients, "C1s--", markersize=4, linewidth=0.8, label="Bernstein coefficients")
        axis.set(xlabel="place in the interval", xticks=[0, 0.5, 1], xlim=(-0.05, 1.05), ylim=(-0.9, 1.5))
    axes[0].set(ylabel="share of the limit", title="values at the nodes limited")
    axes[1].set(title="coefficients limited")
    axes[1].legend(fontsize=7, loc="lower right")
    figure.savefig(PICTURE, metadata={"Date": None})


if __name__ == "__main__":
    mpl.rcParams.update({"svg.hashsalt": "hopopt", "font.size": 8})
    draw()
