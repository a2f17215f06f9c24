"""
Periodic shear
==============

A packing in a periodic box, without walls, is compressed, kept under a pressure, and sheared: how
much shear stress does it bear, and does it expand?
"""

# %%
# A periodic packing
# ------------------
# What leaves the box on one side enters it on the other. `packing` makes discs without overlap that
# may lie across the edges.

import matplotlib.pyplot as plt
import numpy as np

import skmpm

radii = np.random.default_rng(1).uniform(0.7e-3, 1.2e-3, 20)
width = np.sqrt(np.pi * np.sum(radii**2) / 0.78)
loose = skmpm.packing(radii, width, solid_fraction=0.78, periodic=True, seed=1)
rubber = skmpm.NeoHookean(E=10e6, nu=0.45, density=990.0)
bodies = [
    skmpm.Body(skmpm.disc(x, r, spacing=0.14e-3), rubber)
    for x, r in zip(loose.centres.T, loose.radii, strict=True)
]


def scene(**motion):
    box = skmpm.Periodic(loose.width, loose.height, **motion)
    return skmpm.Scene(bodies, cell=0.19e-3, friction=0.5, periodic=box)


# %%
# Compression
# -----------
# The box moves with a velocity gradient, its `rate`. Both edges shorten until the packing bears a
# pressure; no wall disturbs the order of the discs.

squeezed = scene(rate=[[-4.0, 0.0], [0.0, -4.0]])
print(skmpm.preflight(squeezed))
for state in skmpm.simulate(squeezed, until=0.05):
    if skmpm.observe(squeezed, state).pressure > 1e5:
        break
print(f"solid fraction {skmpm.observe(squeezed, state).solid_fraction:.3f} under {1e5:g} Pa")

# %%
# Shear under a pressure
# ----------------------
# In the next stage the box is sheared at 4 per second, and its height follows from the vertical
# stress, -P: components of the `stress` that are nan have the given rate instead. The height is an
# unknown of the contact problem, so the stress is exact at the end of every step, but for the
# inertia of the box.

P, RATE, nan = 1e5, 4.0, float("nan")
sheared = scene(rate=[[0.0, RATE], [0.0, nan]], stress=[[nan, nan], [nan, -P]])
start = skmpm.continued(squeezed, state, sheared)
rows = []
for state in skmpm.simulate(sheared, until=start.t + 0.2 / RATE, start=start):
    seen = skmpm.observe(sheared, state)
    strain = RATE * (state.t - start.t)
    rows.append((strain, seen.stress[0, 1], -seen.stress[1, 1], seen.solid_fraction))
strain, shear, pressure, fraction = np.array(rows).T

figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
left.plot(strain, shear / P, label="shear stress / P")
left.plot(strain, pressure / P, label="vertical stress / P")
left.set(xlabel="shear strain")
left.legend()
right.plot(strain, fraction)
right.set(xlabel="shear strain", title="solid fraction")
late = strain > 0.1
print(f"friction coefficient of the packing: {np.mean(shear[late] / pressure[late]):.2f}")

# %%
# Twenty discs fluctuate; a study takes more, and several packings (`skmpm.sweep`). The picture
# shows the box, and faded images around it. Chains of force lean against the shear.

skmpm.plot(sheared, state, forces=True)
