"""
Pour and settle
===============

Grains of several shapes fall into a box under gravity, collide, and come to rest. Then a lid is
put on the pile.
"""

# %%
# Loose grains in the air
# -----------------------
# Soft grains of about 1 cm: discs, ellipses, capsules and pentagons with rounded corners, in rows
# with random offsets and angles.

import matplotlib.pyplot as plt
import numpy as np

import skmpm

R, rng = 5e-3, np.random.default_rng(2)
jelly = skmpm.NeoHookean(E=5e4, nu=0.45, density=1000.0, viscosity=2.0)


def grain(kind, x, y):
    centre, options = (x, y), {"spacing": R / 6, "angle": rng.uniform(0.0, 2.0 * np.pi)}
    if kind == 0:
        return skmpm.disc(centre, R, spacing=R / 6)
    if kind == 1:
        return skmpm.ellipse(centre, (1.25 * R, 0.8 * R), **options)
    if kind == 2:
        return skmpm.capsule(centre, 0.9 * R, 0.75 * R, **options)
    return skmpm.polygon(centre, 1.2 * R, 5, rounding=0.3 * R, **options)


places = [(x, y) for y in (1.5, 4.1, 6.7, 9.3) for x in (1.6, 4.6, 7.6)]
bodies = [
    skmpm.Body(grain(k % 4, (x + rng.uniform(-0.2, 0.2)) * R, y * R), jelly)
    for k, (x, y) in enumerate(places)
]
box = [
    skmpm.Wall((0.0, 0.0), (0.0, 1.0)),
    skmpm.Wall((0.0, 0.0), (1.0, 0.0)),
    skmpm.Wall((9.2 * R, 0.0), (-1.0, 0.0)),
]
scene = skmpm.Scene(bodies, cell=R / 4, gravity=(0.0, -9.81), walls=box, friction=0.5)
print(skmpm.preflight(scene))

# %%
# The viscosity of the material (2 Pa s) damps the oscillations of the grains after impacts. Steps
# are short in impacts, and long when nothing moves any more.

states = [skmpm.initial(scene), *skmpm.simulate(scene, until=0.6)]
print(
    f"{len(states) - 1} steps, of {1e3 * min(s.report.dt for s in states[1:]):.2g} to"
    f" {1e3 * max(s.report.dt for s in states[1:]):.2g} ms"
)

figure, axes = plt.subplots(1, 3, figsize=(10, 4.5), layout="constrained")
for axis, time in zip(axes, (0.0, 0.08, 0.6), strict=True):
    state = min(states, key=lambda s: abs(s.t - time))
    skmpm.plot(scene, state, "speed", axes=axis, limits=(0.0, 0.5), legend=axis is axes[-1])
    axis.set_title(f"t = {state.t:.2f} s")

# %%
# Is it at rest?
# --------------
# The kinetic energy has decayed, the floor and the side walls carry the weight.

weight = 9.81 * state.mass.sum()
carried = -state.wall_force[:, 1].sum()
print(f"kinetic energy {state.report.energy.kinetic:.1e} J/m")
print(f"the walls carry {carried / weight:.4f} of the weight")

# %%
# Another stage: a lid
# --------------------
# A scene is frozen; `dataclasses.replace` makes another one. `continued` takes the state over into
# it: the bodies stay as they are, walls that both scenes have go on from where they are, and a new
# one begins at its `point`. Here a lid is put on the pile, and comes down slowly.

from dataclasses import replace

top = state.x[1].max()
lid = skmpm.Wall((0.0, top + 0.1 * R), (0.0, -1.0), velocity=(0.0, -0.1))
covered = replace(scene, walls=[*box, lid])
start = skmpm.continued(scene, state, covered)
states = list(skmpm.simulate(covered, until=state.t + 0.08, start=start))
print(f"force on the lid {states[-1].wall_force[3, 1] / weight:.1f} times the weight of the pile")
skmpm.plot(covered, states[-1], forces=True)
