"""Figures of the manufactured solutions."""

import numpy as np
from manufactured_rates import GRIDS, RING, in_space, in_time, offsets
from pictures import canvas, keep, ticks


def _slope(panel, x, y, order):
    """A line of this order through the last point."""
    x = np.asarray(x, dtype=float)
    panel.plot(x, y * (x / x[-1]) ** order, "k:", lw=0.8)
    middle = np.sqrt(x[0] * x[-1])
    panel.annotate(f"order {order}", (middle, y * (middle / x[-1]) ** order), fontsize=7, va="top", ha="left")


def draw_space(file):
    """Error over h: the square and the ring."""
    figure, (left, right) = canvas()
    coarse = (8, 16, 32)
    for per_cell, colour in ((3, "C1"), (4, "C2")):
        for k, error in enumerate(offsets(per_cell)):
            label = f"cut, {per_cell} x {per_cell} points" if k == 0 else None
            left.loglog(1.0 / np.array(coarse), error, color=colour, lw=0.8, alpha=0.7, label=label)
    aligned = in_space("square", GRIDS, 2, 128)[:, 0]
    left.loglog(1.0 / np.array(GRIDS), aligned, "ko-", ms=4, label="aligned, 2 x 2 points")
    _slope(left, 1.0 / np.array(GRIDS), 0.7 * aligned[-1], 2)
    for per_cell, fitted, style in ((3, True, "ko-"), (2, False, "C1s--")):
        error = in_space("vortex", RING, per_cell, 32, fitted=fitted)[:, 0]
        label = f"{per_cell} x {per_cell} points, {'fitted' if fitted else 'volumes as'} weights"
        right.loglog(1.0 / np.array(RING), error, style, ms=4, label=label)
    _slope(right, 1.0 / np.array(RING), 0.7 * in_space("vortex", RING, 3, 32)[-1, 0], 2)
    for panel, cells, title in ((left, GRIDS, "square between sliding walls"), (right, RING, "generalised vortex")):
        ticks(panel, 1.0 / np.array(cells), [f"1/{n}" for n in cells])
        panel.set(xlabel="cell size h [m]", ylabel="relative L2 error of the displacement", title=title)
        panel.legend(fontsize=6)
    keep(figure, file)


def draw_time(file):
    """Error over dt: the bar and the square."""
    figure, panels = canvas()
    for panel, name in zip(panels, ("bar", "square"), strict=True):
        for theta, steps, colour in ((0.5, (8, 16, 32, 64), "C0"), (1.0, (64, 128, 256, 512), "C3")):
            found, dt = in_time(name, steps, theta), 0.02 / np.array(steps)
            panel.loglog(dt, found[:, 0, 0], colour + "o-", ms=4, label=rf"$\theta$ = {theta:g}")
            panel.loglog(dt, found[:, 1, 0], colour + "-", lw=0.6)
        _slope(panel, 0.02 / np.array((8, 64)), 0.7 * in_time(name, (8, 16, 32, 64), 0.5)[-1, 0, 0], 2)
        panel.set(xlabel="time step [s]", title=f"{name}, h = 1/16")
        panel.legend(fontsize=6)
    panels[0].set_ylabel("relative L2 error of the displacement")
    keep(figure, file)
