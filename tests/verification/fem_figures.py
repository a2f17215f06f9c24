"""The figures of test_fem_elasticity."""

from io import BytesIO

import matplotlib.pyplot as plt
import numpy as np
from fem_problems import COOK, DISC, PLATE, PROBLEMS, material_points
from PIL import Image

OFFSET = (0.37, 0.71)  # of the grid in the pictures of stress, in cells
COLOURS = ("C0", "C3")  # displacement, stress
SCALE = {COOK.name: 28.0, PLATE.name: 85.0}  # of the pictures, in points of 1/72 inch to the metre


def draw_errors(file, of_q1, aligned, cut):
    """Errors over h on logarithmic scales, one panel for each problem."""
    figure, panels = plt.subplots(1, 4, figsize=(9.0, 3.5), layout="constrained")
    for problem, panel in zip(PROBLEMS, panels, strict=True):
        h, scattered = np.array(problem.sizes), cut(problem)
        mean = scattered.mean(axis=1)
        spread = np.stack([mean - scattered.min(axis=1), scattered.max(axis=1) - mean])
        for k, (colour, what) in enumerate(zip(COLOURS, ("u", "stress"), strict=True)):
            panel.plot(h, of_q1(problem)[:, k], "--", color=colour, lw=1, label=f"{what}, Q1 FEM")
            panel.errorbar(
                h, mean[:, k], spread[:, :, k], fmt="o-", color=colour, ms=4, capsize=3, label=f"{what}, cut"
            )
            if problem is not DISC:
                panel.plot(h, aligned(problem)[:, k], "x", color=colour, ms=7, mfc="none", label=f"{what}, aligned")
            order = 2 - k
            low = 0.5 * mean[-1, k] * (h / h[-1]) ** order
            panel.plot(h, low, ":", color="0.5", lw=1)
            panel.annotate(f"{order}", (h[1], low[1]), color="0.4", textcoords="offset points", xytext=(4, -9))
        panel.set(title=problem.name, xscale="log", yscale="log", xlabel="h [m]")
        panel.set_xticks(h, [f"{v:g}" for v in h])
        panel.minorticks_off()
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("relative L2 error")
    figure.legend(*panels[0].get_legend_handles_labels(), fontsize=8, ncol=6, loc="outside lower center")
    _save(figure, file)


def draw_stress(file):
    """Stress and its error at the points of Cook's membrane and of the plate with a hole."""
    figure, panels = plt.subplots(2, 2, figsize=(7, 5.6), layout="constrained")
    for problem, name, scalar, row in (
        (COOK, "mean stress [kPa]", lambda s: (s[0, 0] + s[1, 1]) / 2, panels[0]),
        (PLATE, "tension along x [kPa]", lambda s: s[0, 0], panels[1]),
    ):
        h = problem.sizes[1]
        field, _ = material_points(problem, h, offset=OFFSET, spacing=1 / 4)
        exact, own = (scalar(s) / 1e3 for s in (problem.known(field.x)[1], field.stress))
        scale = np.quantile(np.abs(exact), 0.998)
        options = {"lw": 0, "cmap": plt.get_cmap("RdBu_r", 21), "vmin": -scale, "vmax": scale}
        size = 1.5 * field.weight * SCALE[problem.name] ** 2
        for panel, value, title in zip(row, (own, 5 * (own - exact)), (name, "error x 5"), strict=True):
            dots = panel.scatter(*field.x, c=value, s=size, **options)
            _grid(panel, field.x, h)
            panel.set(aspect="equal")
            panel.set_title(f"{problem.name}: {title}", fontsize=9)
        figure.colorbar(dots, ax=row, shrink=0.9)
    _save(figure, file, dpi=90)


def _grid(panel, x, h):
    """The lines of the grid behind the points."""
    for axis, draw in ((0, panel.axvline), (1, panel.axhline)):
        offset = OFFSET[axis]
        first, last = np.floor(x[axis].min() / h + offset), np.ceil(x[axis].max() / h + offset)
        for line in (np.arange(first, last + 1) - offset) * h:
            draw(line, color="0.85", lw=0.4, zorder=0)


def _save(figure, file, dpi=120):
    """As a small PNG of 128 colours."""
    buffer = BytesIO()
    figure.savefig(buffer, dpi=dpi)
    plt.close(figure)
    Image.open(buffer).convert("RGB").quantize(128).save(file, optimize=True)
