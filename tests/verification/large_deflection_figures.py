"""Figures of the large deflections."""

import numpy as np
from large_deflection import LOADS, column, elastica_curve, off_elastica, slender, stretched
from large_deflection_rows import CELLS, COLUMNS
from pictures import canvas, keep, ticks

from skmpm import StepFailed


def draw_beams(file):
    """Centre lines against the elastica, and errors over the cells across the depth."""
    figure, (left, right) = canvas()
    lines, cells = slender(8)[1], (2, 4, 8, 16)
    errors = 100 * np.abs([off_elastica(n) for n in cells])
    for i, k in enumerate(LOADS):
        left.plot(*elastica_curve(k)[2:], "k-", lw=1)
        left.plot(*lines[k - 1][:, ::24], f"C{i}o", ms=3, label=f"k = {k}")
        right.loglog(cells, errors[:, i, 0], f"C{i}o-", ms=4, label=f"deflection, k = {k}")
        right.loglog(cells, errors[:, i, 1], f"C{i}s--", ms=3, lw=0.8)
    right.loglog(cells, 16 / np.array(cells) ** 2.0, "k:", lw=0.8, label="order 2")
    right.axhline(1.5, color="k", lw=0.5)
    ticks(right, cells, [str(n) for n in cells])
    left.set(xlabel="x / L", ylabel="y / L", aspect="equal", title="L/d = 40; black: elastica")
    right.set(xlabel="cells over the depth", ylabel="error of the tip [%]", title="dashed: shortening")
    for panel in (left, right):
        panel.legend(fontsize=6)
    keep(figure, file)


def draw_column(file):
    """Stress over the height, and errors over h."""
    figure, (left, right) = canvas()
    names = ("once", "every step", "at strains of 0.2", "every step, plain weights")
    for i, (_, options) in enumerate(COLUMNS):
        _, Y, stress = column(32, 2, **options)
        if i in (0, 1, 3):
            left.plot(stress / 1e3, Y, f"C{i}.", ms=2, label=names[i])
        error = np.array([column(n, 2, **options)[0] for n in CELLS]).T
        right.loglog(1.0 / np.array(CELLS), error[0], f"C{i}o-", ms=4, label=names[i])
        if i == 0:
            right.loglog(1.0 / np.array(CELLS), error[1], "C0s--", ms=4, label="once, recovered at nodes")
    left.plot([-40.0, 0.0], [0.0, 50.0], "k-", lw=0.8, label="exact")
    ticks(right, 1.0 / np.array(CELLS), [f"1/{n}" for n in CELLS])
    left.set(xlabel="vertical stress [kPa]", ylabel="initial height [m]", title="32 cells")
    right.set(xlabel="cell size / height", ylabel="error of the stress", title="body grids built ...")
    for panel in (left, right):
        panel.legend(fontsize=6)
    keep(figure, file)


def draw_bar(file):
    """Force over stretch, and its error."""
    figure, (left, right) = canvas()
    drawn = ((4, 0.5, True), (4, 0.1, True), (4, 0.0, True), (6, 0.0, True), (6, 0.5, False))
    for i, (per_cell, anchor, fitted) in enumerate(drawn):
        label = f"{per_cell} x {per_cell} points, anchor {anchor:g}" + ("" if fitted else ", plain weights")
        try:
            (stretch, force, exact), _ = stretched(per_cell, anchor, moment_fitting=fitted)
        except StepFailed:
            continue
        left.plot(stretch[i::5], force[i::5] / 1e6, f"C{i}o", ms=4, label=label)
        right.semilogy(stretch, 100 * np.abs(force / exact - 1.0) + 1e-6, f"C{i}-", label=label)
    left.plot(stretch, exact / 1e6, "k-", lw=0.8, label="closed form")
    right.axhline(2.0, color="k", lw=0.5)
    left.set(xlabel="stretch", ylabel="force per initial width [MPa]")
    right.set(xlabel="stretch", ylabel="error of the force [%]", ylim=(1e-4, 2e4))
    for panel in (left, right):
        panel.legend(fontsize=6)
    keep(figure, file)
