"""Isochromatics of discs under two to six radial loads, against the field of point forces.

Problem: a disc between 2, 3, 4 or 6 smooth plates, linear elastic, quasi-static, pressed by 0.01 R. Reference: each
force P gives radial stresses -2 P cos(theta) / (pi r), and the forces of a disc in equilibrium together a uniform
tension, which no fringe shows (Timoshenko & Goodier, Theory of Elasticity, section 41). Two loads give a difference
of principal stresses of 4 P / (pi R) at the centre, to which errors are relative. They
are those of what `plot` draws.
"""

from functools import cache

import numpy as np
import pytest
from ledger import Row, numbers
from pictures import keep

from skmpm import Body, LinearElastic, Scene, Scheme, Wall, disc, plot, simulate
from skmpm.plot.fringes import light, stress_differences
from skmpm.plot.snapshot import of_state

R, STROKE = 5e-3, 0.01
SIZES = (5, 10, 20)  # R/h
LOADS = (2, 3, 4, 6)
CENTRE = {5: 2.9, 10: 1.1, 20: 0.3}  # goals [%], what points gave without a projection
INSIDE = {5: 8.8, 10: 4.2, 20: 1.6}


def directions(loads):
    """Of the plates from the centre, (loads, 2); two press along y."""
    angle = 0.5 * np.pi + 2.0 * np.pi * np.arange(loads) / loads
    return np.stack([np.cos(angle), np.sin(angle)], axis=1)


@cache
def pressed(loads, size):
    """The scene and the state of a disc between plates, at an odd place of the grid."""
    cell = R / size
    centre = np.array([0.3, 0.1]) * cell
    plates = [Wall(centre + R * d, -d, velocity=-STROKE * R * d) for d in directions(loads)]
    body = Body(disc(centre, R, spacing=0.74 * cell), LinearElastic(1e9, 0.3, 1000.0))
    scene = Scene([body], cell=cell, walls=plates)
    *_, state = simulate(scene, dt=0.25, until=1.0, scheme=Scheme(inertia=False))
    return scene, state


def point_forces(x, force, loads):
    """(s_xx - s_yy, 2 s_xy) (2, n) of radial forces [N/m] on a disc, at places x (2, n) about its centre."""
    total = np.zeros_like(x)
    for d in directions(loads):
        arm = x - R * d[:, None]
        r = np.hypot(*arm)
        e = arm / r
        radial = -2.0 * force * (-d @ e) / (np.pi * r)
        total += radial * np.stack([e[0] ** 2 - e[1] ** 2, 2.0 * e[0] * e[1]])
    return total


def errors(loads, size):
    """Error at the centre and rms within 0.6 R of the difference of principal stresses [%] of 4 P / (pi R)."""
    scene, state = pressed(loads, size)
    force = np.hypot(*state.wall_force.T).mean()
    x = state.x - np.average(state.x, axis=1, weights=state.mass)[:, None]
    found = np.hypot(*stress_differences(of_state(scene, state)))
    error = (found - np.hypot(*point_forces(x, force, loads))) / (4.0 * force / (np.pi * R))
    r = np.hypot(*x)
    return 100.0 * error[r < 0.15 * R].mean(), 100.0 * np.sqrt((error[r < 0.6 * R] ** 2).mean())


@pytest.mark.parametrize("size", SIZES)
def test_a_disc_under_a_diametral_load(size):
    centre, inside = errors(2, size)
    assert abs(centre) < {5: 4.0, 10: 1.0, 20: 0.6}[size]
    assert inside < INSIDE[size]


@pytest.mark.parametrize("loads", LOADS[1:])
def test_discs_with_more_contacts(loads):
    assert errors(loads, 10)[1] < INSIDE[10]
    assert errors(loads, 20)[1] < 0.6 * errors(loads, 10)[1], "it converges"


# The table and the figure.


def rows():
    return [_row(loads) for loads in LOADS]


def _row(loads):
    centre, inside = np.abs([errors(loads, size) for size in SIZES]).T
    met = (centre <= list(CENTRE.values())).all() and (inside <= list(INSIDE.values())).all()
    asked = f"centre {numbers(CENTRE.values())} %, rms {numbers(INSIDE.values())} %: "
    missed = "missed: the projection flattens the field of few cells, and contacts are no points"
    return Row(
        f"fringes, a disc under {loads} radial loads",
        "point forces",
        "R/h = " + numbers(SIZES),
        f"at the centre {numbers(centre)} %; rms within 0.6 R {numbers(inside)} %",
        "-",
        asked + ("met" if met else missed) if loads == 2 else "-",
        "test_a_disc_under_a_diametral_load" if loads == 2 else "test_discs_with_more_contacts",
    )


def figures(folder):
    """Discs with R/h = 20 above, the field of point forces below."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    figure, panels = plt.subplots(2, len(LOADS), figsize=(9.6, 5.0), layout="constrained")
    side = np.linspace(-R, R, 401)
    x = np.stack(np.meshgrid(side, side)).reshape(2, -1)
    for (above, below), loads in zip(panels.T, LOADS, strict=True):
        scene, state = pressed(loads, 20)
        force = np.hypot(*state.wall_force.T).mean()
        fringe = force / (np.pi * R)
        plot(scene, state, "fringes", fringe=fringe, axes=above, legend=False, view=((-1.1 * R, 1.1 * R),) * 2)
        seen = light(point_forces(x, force, loads) / fringe)
        seen[np.hypot(*x) > R] = np.nan
        below.imshow(seen.reshape(401, 401), cmap="gray", origin="lower", vmin=0.0, vmax=1.0)
        above.axis("off"), below.axis("off")
    keep(figure, folder / "fringes.png")
    return {"fringes.png": "Isochromatics of discs under 2, 3, 4 and 6 loads: above `plot(..., \"fringes\")` with"
            " R/h = 20, below the field of point forces; four orders at the centre under two loads."}  # fmt: skip
