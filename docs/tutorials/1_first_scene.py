"""
The first scene
===============

Two soft discs are squeezed between a floor and a lid. This is a complete simulation: a scene, a
check, a loop over states, and a picture.
"""

# %%
# A scene
# -------
# Lengths are in metres, times in seconds; everything is two-dimensional (plane strain), per metre
# of thickness. A *body* is a cloud of material points with a material. `disc` makes one: its
# outermost points lie on the circle and carry contact.

import skmpm

R = 1e-3
gel = skmpm.NeoHookean(E=1e6, nu=0.45, density=1000.0)
below = skmpm.Body(skmpm.disc((0.0, R), R, spacing=R / 8), gel)
above = skmpm.Body(skmpm.disc((0.6 * R, 2.95 * R), R, spacing=R / 8), gel)

# %%
# Walls are rigid half-planes: a point, and a normal towards the bodies. The lid moves down with 0.2
# m/s. Each body moves on a background grid of its own; `cell` is the side of its cells.

scene = skmpm.Scene(
    [below, above],
    cell=R / 5,
    walls=[
        skmpm.Wall((0.0, 0.0), (0.0, 1.0)),
        skmpm.Wall((0.0, 4.0 * R), (0.0, -1.0), velocity=(0.0, -0.2)),
        skmpm.Wall((-1.05 * R, 0.0), (1.0, 0.0)),
        skmpm.Wall((1.65 * R, 0.0), (-1.0, 0.0)),
    ],
    friction=0.3,
)

# %%
# Check it first
# --------------
# `preflight` costs nothing and tells the resolution, the first step and the memory, and warns where
# the scene lies outside of what has been verified.

print(skmpm.preflight(scene))

# %%
# Run it
# ------
# `simulate` yields a `State` after every step. Without ``dt``, it chooses the length of the steps.
# What happens with the states is up to the loop: here we keep the lid's force, and every fifth
# state.

force, states = [], []
for k, state in enumerate(skmpm.simulate(scene, until=5e-3)):
    force.append((state.t, state.wall_force[1, 1]))
    if k % 5 == 0:
        states.append(state)
state

# %%
# Look at it
# ----------
# `plot` fills the bodies with a field, here the pressure, and draws walls; with ``forces=True``
# lines join the centres of bodies that touch, as wide as their force. The boundaries are the smooth
# curves on which contact acts: they touch, they do not overlap.

axes = skmpm.plot(scene, state, forces=True)

# %%
# The force on the lid: nothing until the discs touch, then that of two discs that lean on each
# other and on the walls.

import matplotlib.pyplot as plt
import numpy as np

t, f = np.array(force).T
axes = plt.figure(figsize=(6, 3), layout="constrained").add_subplot()
axes.plot(1e3 * t, f)
axes.set(xlabel="t [ms]", ylabel="force on the lid [N/m]")

# %%
# What is measured
# ----------------
# `observe` returns solid fraction, stress, coordination, contact surface and shapes; `network` the
# contacts by pairs of bodies, walls being -1, -2, ... in the order of the scene.

seen = skmpm.observe(scene, state)
print(f"solid fraction {seen.solid_fraction:.3f}, coordination {seen.coordination:.1f}")
print(f"overlap {seen.overlap:.1e} of the area")
for name, column in skmpm.network(scene, state).table().items():
    print(f"{name:>20}", *(f"{value:11.4g}" for value in column))

# %%
# Where to go next: :doc:`2_compaction` for a packing, :doc:`/how_to/resolution` for the choice of
# cell and spacing.
