"""Two soft discs squeezed between two walls."""

import skmpm

R = 1e-3
gel = skmpm.NeoHookean(E=10e6, nu=0.45, density=990.0)
scene = skmpm.Scene(
    [skmpm.Body(skmpm.disc((0.0, y), R, spacing=R / 8), gel) for y in (R, 3 * R)],
    cell=R / 5,
    walls=[
        skmpm.Wall((0.0, 0.0), (0.0, 1.0), friction=0.5),
        skmpm.Wall((0.0, 4 * R), (0.0, -1.0), velocity=(0.0, -1.0), friction=0.5),
    ],
    friction=0.5,
)


def main() -> skmpm.State:
    print(skmpm.preflight(scene, dt=5e-6))
    for state in skmpm.simulate(scene, dt=5e-6, until=0.4e-3, progress=True):
        floor, lid = state.wall_force[:, 1]
    print(f"lid down by {4 * R - state.walls[1, 1]:.2e} m: it bears {lid:.0f} N/m, the floor {-floor:.0f} N/m")
    print(f"energy [J/m]: {state.report.energy}")
    return state


if __name__ == "__main__":
    main()
