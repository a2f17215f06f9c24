"""
Pressure-controlled compression
===============================

A packing is compressed from two sides by a given pressure, not by a given motion: what presses in
an experiment is often a weight or a membrane.
"""

# %%
# Walls with a pressure
# ---------------------
# A wall with a `pressure` (or a `force`) moves along its normal. Its velocity is an unknown of the
# contact problem: at the end of every step the bodies press on it with exactly what drives it, less
# its own inertia. There is no gain to tune. The pressure acts over the length of the wall between
# the other walls, and may be a function of time.

import matplotlib.pyplot as plt
import numpy as np

import skmpm

radii = np.random.default_rng(3).uniform(0.7e-3, 1.2e-3, 30)
width = np.sqrt(np.pi * np.sum(radii**2) / 0.72)
loose = skmpm.packing(radii, width, solid_fraction=0.74, seed=3)
rubber = skmpm.NeoHookean(E=10e6, nu=0.45, density=990.0)
bodies = [
    skmpm.Body(skmpm.disc(x, r, spacing=0.14e-3), rubber)
    for x, r in zip(loose.centres.T, loose.radii, strict=True)
]
PRESSURE = 2e4
walls = [
    skmpm.Wall((0.0, 0.0), (0.0, 1.0), friction=0.0),
    skmpm.Wall((0.0, loose.height), (0.0, -1.0), pressure=PRESSURE, friction=0.0),
    skmpm.Wall((0.0, 0.0), (1.0, 0.0), friction=0.0),
    skmpm.Wall((width, 0.0), (-1.0, 0.0), pressure=PRESSURE, friction=0.0),
]
scene = skmpm.Scene(bodies, cell=0.19e-3, walls=walls, friction=0.5)
print(skmpm.preflight(scene))

# %%
# First with inertia
# ------------------
# The packing is loose: the walls accelerate (their mass is that of the bodies, unless `mass` says
# otherwise), meet resistance, swing, and come to rest. Backward Euler damps the swinging.

rows = []
for state in skmpm.simulate(scene, until=0.02):
    seen = skmpm.observe(scene, state)
    rows.append((state.t, seen.pressure, seen.solid_fraction))
t, pressure, fraction = np.array(rows).T
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
left.plot(1e3 * t, 1e-3 * pressure)
left.axhline(1e-3 * PRESSURE, color="k", ls="--")
left.set(xlabel="t [ms]", title="pressure in the packing [kPa]")
right.plot(1e3 * t, fraction)
right.set(xlabel="t [ms]", title="solid fraction")
print(f"at the end {pressure[-1] / PRESSURE:.5f} of the pressure of the walls")

# %%
# Then without
# ------------
# Now that the packing is jammed, it has an equilibrium for every pressure. The next stage raises
# the pressure twentyfold in steps without inertia; time is only a parameter.

from dataclasses import replace

begin = state.t


def ramp(t):
    return PRESSURE * (1.0 + 19.0 * (t - begin))


higher = replace(scene, walls=[w if not w.driven else replace(w, pressure=ramp) for w in walls])
start = skmpm.continued(scene, state, higher)
scheme = skmpm.Scheme(inertia=False)
rows = []
for state in skmpm.simulate(higher, until=begin + 1.0, dt=0.05, start=start, scheme=scheme):
    seen = skmpm.observe(higher, state)
    rows.append((seen.solid_fraction, seen.pressure, ramp(state.t), seen.contact_surface))
fraction, pressure, wanted, surface = np.array(rows).T
print(f"largest deviation from the pressure: {np.abs(pressure / wanted - 1.0).max():.1e}")
figure, (left, right) = plt.subplots(1, 2, figsize=(9, 3), layout="constrained")
left.plot(fraction, pressure / rubber.E, ".-")
left.set(xlabel="solid fraction", title="pressure / E")
right.plot(fraction, surface, ".-")
right.set(xlabel="solid fraction", title="share of the perimeters in contact")

# %%
# The picture: isotropic loading leaves the lines of force without a direction.

skmpm.plot(higher, state, forces=True)
