"""One large body by algebraic multigrid: a suspended disc deforms under its weight, in one or many steps.

    OPENBLAS_NUM_THREADS=1 python -m examples.studies.benchmark large --points 1000000

The position on the grid is random, so that cells are cut at random. Prints iterations, seconds by phase (those of
solves are in the bulk), memory, and the relative error of the balance of support force, weight and inertia.
"""

import argparse
from functools import partial
from time import process_time

import numpy as np

import skmpm
from examples.large import GRAVITY, hanging

from .measure import Recorder, peak, timed

COURANT = 10.0  # cells that a pressure wave crosses in the dynamic step


def time_step(scene: skmpm.Scene) -> float:
    """In which a pressure wave crosses `COURANT` cells [s]."""
    return COURANT * scene.cell / scene.fastest_wave


def advance(scene: skmpm.Scene, inertia: bool) -> dict[str, float]:
    """One step from rest: what it took and what came out."""
    iterations: list[int] = []
    recorder = Recorder(partial(skmpm.linear.amg, callback=iterations.append))
    scheme, dt, began = skmpm.Scheme(inertia=inertia, linear=recorder), time_step(scene), process_time()
    start = skmpm.initial(scene, scheme=scheme)
    built = process_time() - began
    state, times, phases = timed(scene, start, dt, scheme)

    weight = GRAVITY * state.mass.sum()
    inertial = (state.v - start.v) @ state.mass / dt if inertia else np.zeros(2)
    balance = np.array([0.0, -weight]) - state.support_force[0] - inertial
    return {
        "points": state.x.shape[1],
        "unknowns": recorder.matrices[-1].shape[0],
        "iterations": max(iterations),
        "build": built,
        "set up": phases["factorisation"],
        "bulk": phases["bulk"],
        "rest": times["step"] - phases["factorisation"] - phases["bulk"],
        "memory": peak(),
        "sag": float(start.x[1].min() - state.x[1].min()),
        "balance": float(np.abs(balance).max() / weight),
    }


def main(options: argparse.Namespace) -> dict[str, dict[str, float]]:
    """Print and return what both steps took."""
    scene = hanging(options.points, options.nu, options.seed)
    print(skmpm.preflight(scene, time_step(scene), scheme=skmpm.Scheme(linear=skmpm.linear.amg)))
    print("                points  unknowns iterations   seconds:  build   set up    bulk    rest  peak MB  balance")
    taken = {}
    for name in ("quasi-static", "dynamic"):
        taken[name] = found = advance(scene, inertia=name == "dynamic")
        print(
            f"{name:12s} {found['points']:9d} {found['unknowns']:9d} {found['iterations']:10d}"
            f" {found['build']:21.2f} {found['set up']:7.2f} {found['bulk']:7.2f} {found['rest']:7.2f}"
            f" {found['memory']:8.0f} {found['balance']:8.0e}",
            flush=True,
        )
    print(f"the lowest point sinks by {taken['quasi-static']['sag']:.4g} m")
    return taken


def parser() -> argparse.ArgumentParser:
    """The options."""
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--points", type=int, default=1_000_000)
    options.add_argument("--nu", type=float, default=0.3)
    options.add_argument("--seed", type=int, default=0, help="of the place of the disc on the grid")
    return options
