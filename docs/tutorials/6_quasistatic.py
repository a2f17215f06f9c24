"""
Steps without inertia
=====================

Slow loading needs no inertia: each step finds an equilibrium. A disc is pressed between two plates,
and its force is compared with Hertz's theory of line contact.
"""

# %%
# Time is only a parameter here: the lid moves by 0.08 R in "one second", in twenty steps. Material
# and discretisation are as in any scene.

import matplotlib.pyplot as plt
import numpy as np

import skmpm

R, E, nu, STROKE = 1e-2, 1e6, 0.3, 0.08
solid = skmpm.LinearElastic(E=E, nu=nu, density=1000.0)
disc = skmpm.Body(skmpm.disc((0.0, R), R, spacing=R / 20), solid)
plates = [skmpm.Wall((0, 0), (0, 1)), skmpm.Wall((0, 2 * R), (0, -1), velocity=(0.0, -STROKE * R))]
scene = skmpm.Scene([disc], cell=R / 10, walls=plates)
scheme = skmpm.Scheme(inertia=False)
print(skmpm.preflight(scene, dt=0.05, scheme=scheme))

# %%
# Every step reports how it was solved: Newton iterations, the residual of the contact law, and the
# largest resultant force on a body over the mean contact force, the measure of equilibrium of the
# discrete element method.

states = list(skmpm.simulate(scene, dt=0.05, until=1.0, scheme=scheme))
print(states[-1].report)
print(f"unbalanced force ratio {max(s.report.unbalanced for s in states):.1e}")

# %%
# Against Hertz
# -------------
# With :math:`E^* = E / (1 - \nu^2)`, a contact of half-width :math:`a = \sqrt{4 P R / \pi E^*}`
# flattens by :math:`d = \frac{P}{\pi E^*} (2 \ln \frac{4 R}{a} - 1)`, and the disc has two of them.

P = np.linspace(1.0, -states[-1].wall_force[0, 1], 200)
plane = E / (1.0 - nu**2)
d = P / (np.pi * plane) * (2.0 * np.log(4.0 * R / np.sqrt(4.0 * P * R / (np.pi * plane))) - 1.0)
axes = plt.figure(figsize=(6, 3.5), layout="constrained").add_subplot()
axes.plot(2.0 * d / R, P, "k--", label="Hertz")
axes.plot([STROKE * s.t for s in states], [-s.wall_force[0, 1] for s in states], ".", label="skmpm")
axes.set(xlabel="approach of the plates / R", ylabel="force [N/m]")
axes.legend()

# %%
# The pressure of the contact
# ---------------------------
# Forces of single boundary points depend on where they lie. `contact_pressure` returns means over
# about a cell, which do not.

traction = skmpm.contact_pressure(scene, states[-1], 0)
floor = np.flatnonzero(traction.x[1] < 0.2 * R)
floor = floor[np.argsort(traction.x[0, floor])]
a = np.sqrt(4.0 * P[-1] * R / (np.pi * plane))
x = np.linspace(-a, a, 201)
axes = plt.figure(figsize=(6, 3.5), layout="constrained").add_subplot()
axes.plot(x / R, 2.0 * P[-1] / (np.pi * a) * np.sqrt(1.0 - (x / a) ** 2), "k--", label="Hertz")
axes.plot(traction.x[0, floor] / R, traction.pressure[floor], ".-", label="contact_pressure")
axes.set(xlabel="x / R", ylabel="pressure [Pa]")
axes.legend()

# %%
# Loose bodies, friction and large strains work as well: :doc:`/theory/steps` explains how bodies
# without supports find their equilibrium.
