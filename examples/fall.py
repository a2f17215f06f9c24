"""One body in free fall: no contact module, no wall, one solve per step."""

import skmpm

jelly = skmpm.LinearElastic(E=1e5, nu=0.3, density=1000.0)
scene = skmpm.Scene(
    [skmpm.Body(skmpm.box((0.0, 0.0), (0.2, 0.1), spacing=0.005), jelly, velocity=(1.0, 2.0))],
    cell=0.01,
    gravity=(0.0, -9.81),
)


def main() -> skmpm.State:
    print(skmpm.preflight(scene, dt=1e-3))
    *_, state = skmpm.simulate(scene, dt=1e-3, until=0.4)
    x, y = state.x @ state.mass / state.mass.sum()
    print(
        f"t = {state.t:.3f} s: centre at ({x:.4f}, {y:.4f}) m; a stone would be at (0.5000, {0.85 - 9.81 * 0.08:.4f})"
    )
    return state


if __name__ == "__main__":
    main()
