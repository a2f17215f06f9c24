"""Grains that yield
=================

Nine ductile grains are pressed far beyond yield by a lid and released: they keep flat faces where they touched.

    python examples/powder.py

`ElastoPlastic` is von Mises plasticity at finite strain. Its internal variables are in `State.internal`, the first of
them is the equivalent plastic strain; what the flow dissipates is `Energy.plastic`. Steps are chosen by `simulate`.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt

import skmpm

R, SPEED, TURN = 1e-3, 0.4, 2.5e-3  # [m], [m/s], [s] at which the lid turns back
metal = skmpm.ElastoPlastic(E=1e6, nu=0.3, density=1000.0, yield_stress=2e4, hardening=5e4)
centres = [((1 + 2 * i + row % 2) * R, (1 + 1.75 * row) * R) for row in range(3) for i in range(3)]
scene = skmpm.Scene(
    [skmpm.Body(skmpm.disc(centre, 0.999 * R, spacing=R / 8), metal) for centre in centres],
    cell=R / 5,
    walls=[
        skmpm.Wall((0.0, 0.0), (0.0, 1.0)),
        skmpm.Wall((0.0, 0.0), (1.0, 0.0)),
        skmpm.Wall((7 * R, 0.0), (-1.0, 0.0)),
        skmpm.Wall((0.0, 5.5 * R), (0.0, -1.0), velocity=lambda t: (0.0, -SPEED if t < TURN else SPEED)),
    ],
    friction=0.3,
)


def main(out: Path) -> tuple[float, float, float]:
    """Share of the work that plastic flow took, the shape factor when pressed most and after release."""
    print(skmpm.preflight(scene))
    states = list(skmpm.simulate(scene, until=1.4 * TURN))
    pressed = min(states, key=lambda state: state.walls[3, 1])
    shapes = [skmpm.observe(scene, state).bodies.shape_factor.mean() for state in (pressed, states[-1])]
    share = states[-1].report.energy.plastic / states[-1].report.energy.external
    print(
        f"plastic flow took {share:.0%} of the work; shape factor {shapes[0]:.3f} pressed, {shapes[1]:.3f} released"
    )

    figure, panels = plt.subplots(1, 2, figsize=(9, 3.8), layout="constrained")
    for panel, state, last in zip(panels, (pressed, states[-1]), (False, True), strict=True):
        skmpm.plot(scene, state, "plastic strain", axes=panel, limits=(0.0, 0.35), legend=last)
    out.mkdir(parents=True, exist_ok=True)
    figure.savefig(out / "powder.png", bbox_inches="tight")
    return share, *shapes


if __name__ == "__main__":
    options = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    options.add_argument("--out", type=Path, default=Path("out/powder"), help="directory of the picture")
    main(options.parse_args().out)
