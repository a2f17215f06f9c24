"""
Checkpoints and restart
=======================

A run that is interrupted continues where it was, and ends as if nothing had happened, bit for bit.
"""

# %%
# A `State` holds everything that the next step needs. `save` writes it to a file, `load` reads it;
# loading never executes code.

from pathlib import Path
from tempfile import mkdtemp

import numpy as np

import skmpm

out, R = Path(mkdtemp()), 1e-3
gel = skmpm.NeoHookean(E=1e6, nu=0.45, density=1000.0)
bodies = [
    skmpm.Body(skmpm.disc((2.02 * R * i, R), R, spacing=R / 6), gel, velocity=((1 - i) * 0.5, 0.0))
    for i in range(3)
]
scene = skmpm.Scene(
    bodies,
    cell=R / 4,
    walls=[skmpm.Wall((0, 0), (0, 1), friction=0.2)],
    gravity=(0, -9.81),
    friction=0.2,
)

# %%
# `simulate` writes a checkpoint every 30 seconds of wall time, and when it stops or fails, if it is
# given a path; `record` writes frames for ParaView. Here the loop stops by itself in the middle of
# the run.

with skmpm.record(out / "run.vtkhdf", scene) as film:
    for k, state in enumerate(
        skmpm.simulate(scene, until=3e-4, checkpoint=out / "last.checkpoint")
    ):
        film.write(state)
        if k == 30:
            break
size = (out / "last.checkpoint").stat().st_size
print(f"stopped at t = {state.t:.3g} s; the checkpoint has {size / 1e3:.0f} kB")

# %%
# Later, in another process: the scene is built again by the same lines, the state is loaded, and
# ``append=True`` continues the file.

begun = skmpm.load(out / "last.checkpoint")
with skmpm.record(out / "run.vtkhdf", scene, append=True) as film:
    for resumed in skmpm.simulate(scene, until=3e-4, start=begun):
        film.write(resumed)

# %%
# The same as without interruption?

*_, uninterrupted = skmpm.simulate(scene, until=3e-4)
for name in ("x", "v", "F", "stress"):
    print(name, "identical:", np.array_equal(getattr(resumed, name), getattr(uninterrupted, name)))

# %%
# The recording has the frames of both parts. `read` returns them as arrays, `animate` makes a film
# of them.

recording = skmpm.read(out / "run.vtkhdf")
print(recording, f"from t = {recording.t[0]:.2g} to {recording.t[-1]:.2g} s")
print(recording[-1].bodies["pressure"])
skmpm.plot(scene, resumed, "speed")
