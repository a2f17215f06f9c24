"""Figure and page of the study of mixtures from the tables of its members."""

from __future__ import annotations

import csv
from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

import skmpm
from examples.studies.mixtures import study
from examples.studies.packing_ensemble.fits import compaction_law, last_passage
from examples.studies.pages import DOCS, keep, picture, table
from examples.studies.sweeps import groups
from skmpm.sweep import Member

AT = (0.01, 0.03, 0.1)  # pressures over E of the table, as far as the members go
LEAST = 5e-3  # pressure over E above which laws are fitted,
SAMPLES = 60  # at as many pressures in geometric progression
SETTLED = 5e-3  # pressure over E above which deviations from the given pressure are counted
HEAD = ("rigid", "friction", "ramp [s]", "rigid by area", "Φ at 0.01", "Φ at 0.03", "Φ at 0.1", "its spread",
        "Z at 0.1", "rattlers [%]", "force, rigid pairs", "Φ_max", "its spread", "b", "misfit [%]")  # fmt: skip
CHECKS = ("rigid", "friction", "ramp [s]", "P off, median [%]", "P off, end [%]", "P inside, off [%]",
          "Φ of points, off [%]", "overlap [%]", "circles overlap [D]", "unbalanced", "steps", "retries",
          "contact iterations", "time [min]")  # fmt: skip
SHOWN = (0, 1, 2, 4, 5, 6, 7, 8, 10, 11)  # of the first on the page
WORST = range(3, 10)  # of the second
POINT = ("share", "friction", "ramp")
BESIDE = ("friction", "Φ at 0.01", "ensemble", "Φ at 0.03", "ensemble", "Φ at 0.1", "ensemble")
ENSEMBLE_YOUNG = 10e6  # Young's modulus of `packing_ensemble` [Pa]
STYLES = ("-", "--", ":", "-.")  # of frictions
Point = tuple[float, ...]
Columns = dict[str, np.ndarray]


def pressed(member: Member) -> Columns:
    """The columns of the second stage."""
    later = member.columns["given"] > 0.0
    return {name: np.asarray(column)[later] for name, column in member.columns.items()}


def at(columns: Columns, name: str, pressure: float) -> float:
    """A column where the ramp reaches a pressure over E; nan beyond its end."""
    ramp = columns["given"]
    growing = np.append(True, np.diff(ramp) > 0.0)
    return float(np.interp(pressure, ramp[growing], columns[name][growing], right=np.nan))


def law(columns: Columns) -> tuple[float, float, float] | None:
    """Phi_max and b of the law of compaction, and its rms misfit over the last pressure; None if it is too short."""
    p = np.geomspace(LEAST, columns["given"][-1], SAMPLES)
    phi, Z = (np.array([at(columns, name, each) for each in p]) for name in ("solid_fraction", "coordination"))
    found = compaction_law(phi, Z, p, LEAST)
    if found is None:
        return None
    return found.phi_max, found.b, float(np.sqrt(np.mean((found(phi, Z) - p) ** 2)) / p[-1])


def scene_of(member: Member) -> skmpm.Scene:
    """The scene of a member, whose box moves otherwise in its second stage."""
    return study.build(**member.parameters).scene


def rigid_area(member: Member) -> float:
    """Share of the rigid discs by area."""
    scene = scene_of(member)
    area = np.array([body.points.volume.sum() for body in scene.bodies])
    return float(area[~scene.deformable].sum() / area.sum())


def rigid_force(member: Member) -> float:
    """Mean normal force between two rigid discs over that of all pairs in the last state; nan without such a pair."""
    scene = scene_of(member)
    pairs = skmpm.network(scene, member.state())
    rigid = ~scene.deformable[pairs.bodies].any(axis=0)
    return float(pairs.force[0, rigid].mean() / pairs.force[0].mean()) if rigid.any() else np.nan


def mean(values: Sequence[float], digits: int) -> str:
    """Mean of the packings."""
    return "-" if np.isnan(values).any() else f"{np.mean(values):.{digits}f}"


def spread(values: Sequence[float], digits: int) -> str:
    """Difference of the largest and the smallest of the packings."""
    return "-" if np.isnan(values).any() else f"{np.ptp(values):.{digits}f}"


def line(point: Point, members: list[Member]) -> tuple[str, ...]:
    """A row of the table of packings."""
    columns = [pressed(member) for member in members]
    phi = [[at(c, "solid_fraction", p) for c in columns] for p in AT]
    laws = [law(c) for c in columns]
    limit, b, misfit = ([np.nan if each is None else each[i] for each in laws] for i in range(3))
    return (
        *(f"{value:g}" for value in point),
        mean([rigid_area(member) for member in members], 2),
        *(mean(values, 3) for values in phi),
        spread(phi[-1], 3),
        mean([at(c, "coordination", AT[-1]) for c in columns], 2),
        mean([100 * float(c["rattlers"][-1]) for c in columns], 0),
        mean([rigid_force(member) for member in members], 2),
        mean(limit, 2),
        spread(limit, 2),
        mean(b, 3),
        mean([100 * value for value in misfit], 1),
    )


def check(point: Point, members: list[Member]) -> tuple[str, ...]:
    """A row of the table of checks: the worst of the packings, and means of what they cost."""
    columns = [pressed(member) for member in members]

    def most(of: Callable[[Columns], float]) -> str:
        return f"{max(of(c) for c in columns):.1g}"

    def off(c: Columns, name: str = "pressure", other: str = "given") -> np.ndarray:
        return np.asarray(100 * np.abs(c[name] / c[other] - 1.0))

    def median(c: Columns) -> float:
        late = c["given"] > min(SETTLED, 0.5 * c["given"][-1])
        return float(np.median(off(c)[late]))

    return (
        *(f"{value:g}" for value in point),
        most(median),
        most(lambda c: float(off(c)[-1])),
        most(lambda c: float(off(c, "pressure_inside", "pressure")[-1])),
        most(lambda c: float(off(c, "solid_fraction_points", "solid_fraction").max())),
        most(lambda c: float(100 * c["overlap"].max())),
        most(lambda c: float(c["overlap_rigid"].max())),
        most(lambda c: float(c["unbalanced"][-1])),
        f"{np.mean([member.rows for member in members]):.0f}",
        f"{np.mean([member.columns['retries'].sum() for member in members]):.0f}",
        f"{np.mean([c['contact'].mean() for c in columns]):.0f}",
        f"{np.mean([member.columns['seconds'].sum() for member in members]) / 60:.1f}",
    )


def draw(found: skmpm.Sweep, folder: Path) -> None:
    """Solid fraction over pressure and over shares of rigid discs, last states of two mixtures; and all tables."""
    figure, axes = plt.subplots(1, 4, figsize=(15, 3.8), layout="constrained", width_ratios=(1.1, 1, 1.1, 1.1))
    by_point = groups(found, *POINT)
    shortest = min(ramp for _, _, ramp in by_point)
    chosen = {point[:2]: members for point, members in by_point.items() if point[2] == shortest}
    draw_curves(axes[0], chosen)
    draw_shares(axes[1], chosen)
    draw_states(axes[2:], chosen)
    picture(figure, folder / "mixtures.png", 110)
    files = {"members": [HEAD, *(line(*group) for group in by_point.items())],
             "checks": [CHECKS, *(check(*group) for group in by_point.items())]}  # fmt: skip
    keep(folder, files)


def draw_curves(axis: Axes, chosen: dict[tuple[float, float], list[Member]]) -> None:
    """Solid fraction over pressure, a colour for each share of rigid discs and a style for each friction."""
    shares, frictions = (sorted({point[i] for point in chosen}) for i in (0, 1))
    for (share, friction), members in chosen.items():
        style = STYLES[frictions.index(friction) % len(STYLES)]
        for member in members:
            columns, labelled = pressed(member), member is members[0] and friction == frictions[0]
            axis.semilogx(columns["given"], columns["solid_fraction"], style, color=f"C{shares.index(share)}", lw=1,
                          label=f"rigid {share:g}" if labelled else None)  # fmt: skip
    axis.set(xlabel="P / E", title="solid fraction")
    axis.legend()


def draw_shares(axis: Axes, chosen: dict[tuple[float, float], list[Member]]) -> None:
    """Solid fraction over the share of rigid discs at a low pressure and the last one: packings, and their mean."""
    last = min(member.parameters["until"] for members in chosen.values() for member in members)
    for k, friction in enumerate(sorted({friction for _, friction in chosen})):
        for pressure, marker in ((AT[0], "o"), (last, "s")):
            by_share = {share: [at(pressed(member), "solid_fraction", pressure) for member in members]
                        for (share, mu), members in chosen.items() if mu == friction}  # fmt: skip
            means = [float(np.mean(values)) for values in by_share.values()]
            axis.plot(list(by_share), means, color=f"C{k + 5}", lw=0.8)
            where = [share for share, values in by_share.items() for _ in values]
            each = [value for values in by_share.values() for value in values]
            axis.plot(where, each, marker, color=f"C{k + 5}", ms=4,
                      label=f"friction {friction:g}, P / E = {pressure:g}")  # fmt: skip
    axis.set(xlabel="share of rigid discs", title="solid fraction")
    axis.legend(fontsize="x-small")


def draw_states(axes: Sequence[Axes], chosen: dict[tuple[float, float], list[Member]]) -> None:
    """The last states of the first packing at the middle share, as many frictions as there are axes."""
    shares = sorted({share for share, _ in chosen})
    middle = [members[0] for (share, _), members in chosen.items() if share == shares[len(shares) // 2]]
    for axis, member in zip(axes, middle, strict=False):
        skmpm.plot(scene_of(member), member.state(), "mises", forces=True, axes=axis)
        about = f"friction {member.parameters['friction']:g}"
        axis.text(0.5, -0.02, about, transform=axis.transAxes, ha="center", va="top")
    for axis in axes:
        axis.axis("off")


def ensemble(friction: float) -> tuple[float, ...]:
    """Solid fractions of the isotropic packings of `packing_ensemble` at a friction and the pressures `AT`, means."""
    with (DOCS / "packing_ensemble" / "curves.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["member"].startswith(f"periodic_mu{friction:g}_")]
    packings = {row["member"]: [r for r in rows if r["member"] == row["member"]] for row in rows}
    found = []
    for curve in packings.values():
        phi, p = (np.array([float(row[name]) for row in curve]) for name in ("solid_fraction", "pressure"))
        found.append([last_passage(phi, p / ENSEMBLE_YOUNG, level) for level in AT])
    return tuple(np.mean(found, axis=0)) if found else (np.nan,) * len(AT)


def beside(point: Point, members: list[Member]) -> tuple[str, ...]:
    """A row of the table that compares soft discs with those of `packing_ensemble`."""
    columns = [pressed(member) for member in members]
    own = [float(np.mean([at(c, "solid_fraction", p) for c in columns])) for p in AT]
    pairs = zip(own, ensemble(point[1]), strict=True)
    return (f"{point[1]:g}", *("-" if np.isnan(value) else f"{value:.3f}" for pair in pairs for value in pair))


def short(lines: Sequence[tuple[str, ...]]) -> str:
    """The table of packings on the page."""
    return table([HEAD[k] for k in SHOWN], [[each[k] for k in SHOWN] for each in lines])


def worst(lines: Sequence[tuple[str, ...]]) -> str:
    """The table of checks on the page: the worst of all packings."""
    return table(("check", "worst"), [(CHECKS[k], f"{max(float(each[k]) for each in lines):g}") for k in WORST])


def tables(found: skmpm.Sweep) -> dict[str, str]:
    """The parts of the page that are made of the members."""
    by_point = groups(found, *POINT).items()
    return {
        "members": short([line(*group) for group in by_point]),
        "checks": worst([check(*group) for group in by_point]),
        "ensemble": table(BESIDE, [beside(*group) for group in by_point if group[0][0] == 0.0]),
    }
