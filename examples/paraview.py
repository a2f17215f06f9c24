"""Recording for ParaView
======================

Record a time series for ParaView, and read it back: discs fall into a box.

    python examples/paraview.py

`skmpm.record` writes one file that ParaView (6.0 or later) opens, with blocks of points, bodies and contacts. It is
valid after every frame. `skmpm.read` returns the frames as arrays.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import skmpm

R, DT, UNTIL, EVERY = 0.01, 4e-4, 0.24, 25  # [m], [s], [s], steps between frames
gel = skmpm.NeoHookean(E=2e4, nu=0.3, density=1000.0)
centres = [(2.1 * R * i + 1.2 * R + 0.3 * R * (j % 2), (2.1 * j + 1.5) * R) for j in range(4) for i in range(3)]
bodies = [skmpm.Body(skmpm.disc(centre, R, spacing=R / 6), gel) for centre in centres]
sides = [skmpm.Wall((0, 0), (1, 0), friction=0.0), skmpm.Wall((7 * R, 0), (-1, 0), friction=0.0)]
walls = [skmpm.Wall((0, 0), (0, 1)), *sides]
scene = skmpm.Scene(bodies, cell=R / 4, walls=walls, friction=0.3, gravity=(0.0, -9.81))


def main(out: Path) -> tuple[skmpm.State, skmpm.io.Recording]:
    """The last recorded state, and the frames that were read back."""
    print(skmpm.preflight(scene, DT))
    out.mkdir(parents=True, exist_ok=True)
    with skmpm.record(out / "fall.vtkhdf", scene) as series:
        for step, state in enumerate(skmpm.simulate(scene, dt=DT, until=UNTIL), start=1):
            if step % EVERY == 0:
                series.write(last := state)
    frames = skmpm.read(out / "fall.vtkhdf")
    print(f"{len(frames)} frames of {last.x.shape[1]} points; the last at t = {frames[-1].t:.3f} s")
    figure, axes = plt.subplots(1, 4, figsize=(9, 3.5), layout="constrained")
    top = np.percentile(frames[-1].points["pressure"], 98)
    for axis, frame in zip(axes, [*frames[:18:6], frames[-1]], strict=True):
        dots = axis.scatter(*frame.x, c=frame.points["pressure"], s=2.0, vmin=0.0, vmax=top)
        for line, force in zip(frame.contacts["lines"], frame.contacts["normal_force"], strict=True):
            axis.plot(*line.T, "r", linewidth=3.0 * force / frames[-1].contacts["normal_force"].max())
        axis.set(aspect="equal", title=f"t = {frame.t:.2f} s", xlim=(0, 7 * R), ylim=(0, 9.5 * R))
        axis.set(xticks=[], yticks=[])
    figure.colorbar(dots, ax=axes, label="pressure [Pa]")
    figure.savefig(out / "paraview.png", bbox_inches="tight")
    return last, frames


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/paraview"), help="directory of series and picture")
    main(options.parse_args().out)
