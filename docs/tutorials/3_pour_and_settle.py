"""
Pour and settle
===============

Discs fall into a box under gravity, collide, and come to rest. Then the
floor lifts the pile.
"""

# %%
# Loose discs in the air
# ----------------------
# Soft discs of 1 cm, in rows with random offsets, so that they do not fall as a crystal. Walls have
# a friction coefficient of their own.

import matplotlib.pyplot as plt
import numpy as np

import skmpm

R, rng = 5e-3, np.random.default_rng(2)
jelly = skmpm.NeoHookean(E=5e4, nu=0.45, density=1000.0, viscosity=2.0)
centres = [
    (x + rng.uniform(-0.3, 0.3) * R, y)
    for y in (1.5 * R, 4 * R, 6.5 * R, 9 * R)
    for x in (1.6 * R, 4.6 * R, 7.6 * R)
]
bodies = [skmpm.Body(skmpm.disc(centre, R, spacing=R / 6), jelly) for centre in centres]
box = [
    skmpm.Wall((0.0, 0.0), (0.0, 1.0), friction=0.5),
    skmpm.Wall((0.0, 0.0), (1.0, 0.0), friction=0.5),
    skmpm.Wall((9.2 * R, 0.0), (-1.0, 0.0), friction=0.5),
]
scene = skmpm.Scene(bodies, cell=R / 4, gravity=(0.0, -9.81), walls=box, friction=0.5)
print(skmpm.preflight(scene))

# %%
# The viscosity of the material (2 Pa s) damps the oscillations of the discs after impacts. Steps
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
# Continue in another scene
# -------------------------
# A scene is a frozen dataclass: `dataclasses.replace` makes one that differs. The state continues
# in it, as long as the bodies and their grids are the same and the number of walls, too. Here the
# floor starts to move up, slowly: the pile is lifted.

from dataclasses import replace

moving = replace(scene, walls=[replace(box[0], velocity=(0.0, 0.05)), *box[1:]])
*_, lifted = skmpm.simulate(moving, until=state.t + 0.1, start=state)
rise = np.average(lifted.x[1], weights=lifted.mass) - np.average(state.x[1], weights=state.mass)
print(f"the floor rose by 5 mm, the centre of mass by {1e3 * rise:.2f} mm")
skmpm.plot(scene, lifted, "body", forces=True)
