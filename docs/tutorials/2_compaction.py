"""
Compaction of a packing
=======================

Forty soft discs are compressed in a box far beyond jamming, and the pressure, the coordination and
the shapes of the discs are followed. The same script with 300 discs is the library's main job
(`Nezamabadi et al., 2017 <https://doi.org/10.1016/j.proeng.2017.01.044>`_).
"""

# %%
# A loose packing
# ---------------
# `packing` places rigid discs at random without overlap. Radii are uniform between 0.7 and 1.2 mm.

import matplotlib.pyplot as plt
import numpy as np

import skmpm

radii = np.random.default_rng(1).uniform(0.7e-3, 1.2e-3, 40)
width = np.sqrt(np.pi * np.sum(radii**2) / 0.72)
loose = skmpm.packing(radii, width, solid_fraction=0.70, seed=1)

# %%
# Every disc becomes a soft body. On average their radius is five cells, as packings
# need (:doc:`/how_to/resolution`).

rubber = skmpm.NeoHookean(E=10e6, nu=0.45, density=990.0)
bodies = [
    skmpm.Body(skmpm.disc(x, r, spacing=0.14e-3), rubber)
    for x, r in zip(loose.centres.T, loose.radii, strict=True)
]
speed = 2.0
lid = skmpm.Wall((0.0, loose.height), (0.0, -1.0), velocity=(0.0, -speed), friction=0.0)
walls = [
    skmpm.Wall((0, 0), (0, 1), friction=0.0),
    lid,
    skmpm.Wall((0, 0), (1, 0), friction=0.0),
    skmpm.Wall((width, 0), (-1, 0), friction=0.0),
]
scene = skmpm.Scene(bodies, cell=0.19e-3, walls=walls, friction=0.5)
print(skmpm.preflight(scene))

# %%
# Compress it
# -----------
# The run ends where the discs would fill 90 % of the box if they kept their area.
# `Observables.table` is a row of numbers for each state; pandas makes a data frame of a list of
# them.

until = (loose.height - np.pi * np.sum(radii**2) / (width * 0.90)) / speed
rows, states = [], []
for state in skmpm.simulate(scene, until=until):
    rows.append(skmpm.observe(scene, state).table() | {"t": state.t})
    states.append(state)
print(len(states), "steps;", state.report)

# %%
# Curves
# ------
# Pressure over the solid fraction, and two measures of the discs: the share of their perimeters
# that is in contact, and the ratio of their long to their short extent.

phi = [row["solid_fraction"] for row in rows]
figure, axes = plt.subplots(1, 3, figsize=(10, 3), layout="constrained")
for axis, name, scale in zip(
    axes, ("pressure", "contact_surface", "aspect_ratio"), (1e-6, 1.0, 1.0), strict=True
):
    axis.plot(phi, [scale * row[name] for row in rows])
    axis.set(
        xlabel="solid fraction", title=name.replace("_", " ") + (" [MPa]" if scale < 1.0 else "")
    )

# %%
# Pictures
# --------
# Pressure in the discs, and the network of forces. An array by body colours bodies: here half the
# difference of their principal stresses.

figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4.5), layout="constrained")
skmpm.plot(scene, state, axes=left)
skmpm.plot(
    scene,
    state,
    seen := skmpm.observe(scene, state).bodies.deviatoric_stress,
    axes=right,
    forces=True,
    label="deviatoric stress [Pa]",
)

# %%
# This lid is fast: 2 m/s is a hundredth of the speed of sound in this rubber, and the packing
# resists before it would if it were compressed slowly. A slow lid costs about as many steps, since
# their length is chosen by displacement: set ``speed = 0.02`` and compare.
