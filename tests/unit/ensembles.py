"""Members of the sweeps of `test_sweep.py`, which workers import from here."""

import time

import numpy as np
from threadpoolctl import threadpool_info

import skmpm

R, DT, STEPS = 1e-3, 5e-6, 24
GEL = skmpm.NeoHookean(E=10e6, nu=0.45, density=990.0)


def scene(speed=1.0):
    """A disc that a lid squeezes, by a function of time that chosen steps follow with a dozen in six DT."""
    walls = [
        skmpm.Wall((0, 0), (0, 1)),
        skmpm.Wall((0, 2 * R), (0, -1), velocity=lambda t: (0.0, -speed * (1.0 + 0.5 * np.sin(t / DT)))),
    ]
    return skmpm.Scene([skmpm.Body(skmpm.disc((0, R), R, spacing=R / 4), GEL)], cell=R / 2, walls=walls)


def force(scene, state):
    return {"force": state.wall_force[1, 1], "steps": round(state.t / DT), "newton": state.report.newton}


def slowly(scene, state):
    """The same, in time to be interrupted."""
    time.sleep(0.15)  # a run takes longer than the start of another process on a busy machine
    return force(scene, state)


def squeezed(speed, slow=False):
    """A checkpoint every fifth step or so of a slow run."""
    return skmpm.Run(
        scene(speed), until=STEPS * DT, dt=DT, observe=slowly if slow else force, checkpoint=0.25 if slow else 1e9
    )


def mixed(speed):
    """One member that fails in the middle, one that cannot be built, others that do not fail."""
    if speed == 0.0:
        raise skmpm.SceneError("a lid that does not move")
    return skmpm.Run(scene(speed), until=STEPS * DT, dt=DT, observe=failing if speed == 3.0 else force)


def failing(scene, state):
    if state.t > 6.5 * DT:
        raise ArithmeticError("no force")
    return force(scene, state)


def by_hand(speed):
    """The table of a member by a loop of its own: the text of its file."""
    states = skmpm.simulate(scene(speed), until=STEPS * DT, dt=DT)
    rows = [(state.t, float(state.wall_force[1, 1]), k, state.report.newton) for k, state in enumerate(states, 1)]
    return "".join(f"{','.join(map(repr, row))}\n" for row in rows).join(["t,force,steps,newton\n", ""])


def rows(n, name="a"):
    """A table that build makes itself."""
    return [{"k": k, "root": float(np.sqrt(k)), "even": k % 2 == 0, "text": f"{name}, {k}"} for k in range(n)]


def blas():
    """Threads of the BLAS libraries there are, a row each."""
    return [{"threads": each["num_threads"]} for each in threadpool_info() if each["user_api"] == "blas"]
