"""Restart from a checkpoint
=========================

Checkpoint, kill, resume: a run resumed from a checkpoint ends in the same state, bit for bit.

    python examples/restart.py

A `State` holds all that a restart needs: `save` writes it to one file, `load` reads it (without executing code),
`simulate(start=...)` continues. Here a process that saves every tenth step is killed.
"""

import argparse
from multiprocessing import Process
from pathlib import Path
from time import sleep

import matplotlib.pyplot as plt
import numpy as np

import skmpm

R, DT, UNTIL = 1e-3, 5e-6, 0.4e-3  # [m], [s], [s]
gel = skmpm.NeoHookean(E=10e6, nu=0.45, density=990.0)
bodies = [skmpm.Body(skmpm.disc((0.0, y), R, spacing=R / 8), gel) for y in (R, 3 * R)]
walls = [skmpm.Wall((0.0, 0.0), (0.0, 1.0)), skmpm.Wall((0.0, 4 * R), (0.0, -1.0), velocity=(0.0, -1.0))]
scene = skmpm.Scene(bodies, cell=R / 5, walls=walls, friction=0.5)


def run(checkpoint: Path) -> None:
    """Save every tenth state, with pauses in which the process can be killed."""
    for step, state in enumerate(skmpm.simulate(scene, dt=DT, until=UNTIL), start=1):
        if step % 10 == 0:
            skmpm.save(checkpoint, state)
            sleep(0.2)


def main(out: Path) -> dict[str, bool]:
    """Whether arrays of the final states of the resumed and the uninterrupted run are identical, by name."""
    print(skmpm.preflight(scene, DT))
    out.mkdir(parents=True, exist_ok=True)
    (checkpoint := out / "squeeze.checkpoint").unlink(missing_ok=True)
    worker = Process(target=run, args=(checkpoint,))
    worker.start()
    while not checkpoint.exists():
        sleep(0.01)
    worker.kill()
    worker.join()

    begun = skmpm.load(checkpoint)
    (*_, resumed), (*_, uninterrupted) = (
        skmpm.simulate(scene, dt=DT, until=UNTIL, start=start) for start in (begun, None)
    )
    same = {
        name: np.array_equal(getattr(resumed, name), getattr(uninterrupted, name)) for name in ("x", "v", "F", "C")
    }
    print(f"killed (exit code {worker.exitcode}), resumed from t = {begun.t:.3g} s; identical arrays: {same}")
    figure, axes = plt.subplots(1, 3, figsize=(8, 3.5), layout="constrained")
    for axis, state, name in zip(
        axes, (begun, resumed, uninterrupted), ("killed", "resumed", "uninterrupted"), strict=True
    ):
        skmpm.plot(scene, state, axes=axis, limits=(0.0, 1.5e6), legend=axis is axes[-1])
        axis.set_title(f"{name}, t = {state.t:.2g} s")
    figure.savefig(out / "restart.png", bbox_inches="tight")
    return same


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/restart"), help="directory of checkpoint and picture")
    main(options.parse_args().out)
