"""Pictures: what is drawn, as arrays, against the state."""

import subprocess
import sys
from functools import cache, partial
from importlib import import_module
from itertools import pairwise

import matplotlib
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from matplotlib import pyplot
from matplotlib.animation import PillowWriter
from matplotlib.collections import LineCollection, PathCollection, PolyCollection, TriMesh
from matplotlib.layout_engine import ConstrainedLayoutEngine
from PIL import Image

import skmpm
from skmpm import (
    Body,
    NeoHookean,
    Points,
    Rigid,
    Scene,
    SceneError,
    Scheme,
    Support,
    Wall,
    animate,
    box,
    contact,
    disc,
    initial,
    network,
    outline,
    plot,
    read,
    record,
    simulate,
)
from skmpm.plot import fields, fringes
from skmpm.plot.bodies import body_paths, triangles
from skmpm.plot.snapshot import of_frame, of_state
from skmpm.representation import prefixed
from skmpm.scene import view_of, wall_lines

matplotlib.use("Agg")
GEL = NeoHookean(1e6, 0.45, 1000.0)
R = 1e-3


@pytest.fixture(autouse=True)
def _close():
    yield
    pyplot.close("all")


@pytest.fixture(scope="module")
def squeezed():
    """Two discs on each other under a lid."""
    bodies = [Body(disc((0.0, y * R), R, spacing=R / 6), GEL) for y in (1.0, 3.0)]
    walls = [Wall((0.0, 0.0), (0.0, 1.0)), Wall((0.0, 4 * R), (0.0, -1.0), velocity=(0.0, -1.0))]
    scene = Scene(bodies, cell=R / 4, walls=walls, friction=0.5)
    return scene, list(simulate(scene, dt=2e-5, until=2e-4))


def annulus():
    """A ring of four boundary loops' worth of points: outer radius 2 R, inner radius R."""
    outer, inner = disc((0.0, 0.0), 2 * R, spacing=R / 6), disc((0.0, 0.0), R, spacing=R / 6)
    rim = outer.x[:, outer.outline[0]]
    hole = inner.x[:, inner.outline[0]][:, ::-1]
    own = np.hypot(*outer.x) > 1.08 * R
    own[outer.outline[0]] = False
    x = np.concatenate([rim, hole, outer.x[:, own]], axis=1)
    loops = (np.arange(rim.shape[1]), rim.shape[1] + np.arange(hole.shape[1]))
    return Points(x, np.full(x.shape[1], 3 * np.pi * R**2 / x.shape[1]), loops)


def triangulated(scene, state):
    return triangles(state.x, scene.owner, scene.outlines.point, of_state(scene, state).boundary(),
                     np.arange(len(scene.bodies)))  # fmt: skip


def area(path):
    """Signed area of all loops of a path, holes negative."""
    total = 0.0
    for loop in path.to_polygons():
        x, y = loop.T
        total += 0.5 * np.sum(x[:-1] * y[1:] - x[1:] * y[:-1])
    return total


def size_of(mesh):
    """Area of all triangles, none counted as negative."""
    a, b, c = np.moveaxis(mesh.x[:, mesh.corners], -1, 0)
    (ux, uy), (vx, vy) = b - a, c - a
    return np.abs(ux * vy - uy * vx).sum() / 2


def drawn(axes, kind):
    return [artist for artist in axes.collections if isinstance(artist, kind)]


def test_bodies_are_bounded_by_the_curves_on_which_contact_acts(squeezed):
    """The area within the drawn loops is that within the cubics to the square of the length of their lines."""
    scene, (*_, state) = squeezed
    axes = plot(scene, state, "body")
    (shapes,) = drawn(axes, PathCollection)
    place = scene.outlines.point
    x = state.x[:, place]
    exact = outline.curve(scene.outlines, scene.initial_positions[:, place], x).through(x).area(2)
    assert [area(path) for path in shapes.get_paths()] == pytest.approx(exact, rel=3e-4)
    assert shapes.get_facecolors().shape == (2, 4) and not np.array_equal(*shapes.get_facecolors())
    assert not drawn(axes, TriMesh)


def test_a_hole_is_not_filled():
    scene = Scene([Body(annulus(), GEL)], cell=R / 4)
    state = initial(scene)
    (path,), (body,) = body_paths(of_state(scene, state).boundary())
    assert body == 0 and area(path) == pytest.approx(3 * np.pi * R**2, rel=2e-3)
    mesh = triangulated(scene, state)
    assert size_of(mesh) == pytest.approx(3 * np.pi * R**2, rel=2e-3)
    assert np.hypot(*mesh.x[:, mesh.corners].mean(axis=2)).min() > 0.99 * R


def test_chosen_units_and_view_are_shown(squeezed):
    """Lengths in micrometres of a part of the picture, pressures in Pa; others have no meaning."""
    scene, states = squeezed
    axes = plot(scene, states[-1], units=("um", "Pa"), view=((-R, R), (0.5 * R, 1.5 * R)))
    assert axes.get_xlabel() == "x [um]" and axes.get_xlim() == (-R, R) and axes.get_ylim() == (0.5 * R, 1.5 * R)
    assert axes.xaxis.get_major_formatter()(R, None) == "1000"
    (bar,) = axes.child_axes
    assert bar.get_ylabel() == "pressure [Pa]" and bar.yaxis.get_major_formatter()(2e4, None) == "20000"
    assert plot(scene, states[-1], units="mm").get_xlabel() == "x [mm]"
    with pytest.raises(ValueError, match=r"plot: units has 'inch'; give multiples of Pa, m, .* as \('mm', 'kPa'\)"):
        plot(scene, states[-1], units=("mm", "inch"))
    with pytest.raises(ValueError, match=r"plot: view = \(1.0, 0.0\); give two numbers"):
        plot(scene, states[-1], view=((1.0, 0.0), (0.0, 1.0)))


@pytest.mark.parametrize("layout", [None, "constrained"])
def test_a_colour_bar_does_not_cover_what_is_beside_it(squeezed, layout):
    scene, states = squeezed
    figure, (left, right) = pyplot.subplots(1, 2, figsize=(6, 4), layout=layout)
    for axes in (left, right, left):
        axes.clear()
        plot(scene, states[-1], axes=axes)
    figure.draw_without_rendering()
    assert left.child_axes[0].get_tightbbox().x1 < right.get_tightbbox().x0
    assert right.child_axes[0].get_tightbbox().x1 <= figure.bbox.x1
    assert left.bbox.width == pytest.approx(right.bbox.width)


@cache
def ring_and_box():
    """A state of both and its triangles."""
    scene = Scene([Body(annulus(), GEL), Body(box((3 * R, 0.0), (R, R), spacing=R / 6), GEL)], cell=R / 4)
    state = initial(scene)
    return state, triangulated(scene, state)


@given(st.floats(-2.0, 2.0), st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_linear_fields_are_drawn_exactly(a, b, c):
    state, mesh = ring_and_box()
    field = a + (b * state.x[0] + c * state.x[1]) / R
    # Between boundary points values are linear in the curve's parameter: exact up to the curve's second derivative.
    assert mesh.values(field) == pytest.approx(a + (b * mesh.x[0] + c * mesh.x[1]) / R, abs=0.02)
    assert np.array_equal(mesh.values(field)[: field.size], field)


def test_no_triangle_crosses_a_notch():
    """An L-shaped body: none of the triangles lies in the missing quarter, and together they fill the rest."""
    x, y = (np.ravel(a) for a in np.meshgrid(np.linspace(0, 2 * R, 13), np.linspace(0, 2 * R, 13)))
    own = (x < 1.01 * R) | (y < 1.01 * R)
    x, y = x[own], y[own]
    corners = np.array([[0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2], [0, 0]]) * R
    steps = [a + (b - a) * t for a, b in pairwise(corners)
             for t in np.arange(0, 1 - 1e-9, R / 6 / np.hypot(*(b - a)))]  # fmt: skip
    loop = [int(np.argmin((x - p[0]) ** 2 + (y - p[1]) ** 2)) for p in steps]
    points = Points(np.stack([x, y]), np.full(x.size, 3 * R**2 / x.size), (np.array(loop),))
    scene = Scene([Body(points, GEL)], cell=R / 4)
    state = initial(scene)
    mesh = triangulated(scene, state)
    centre = mesh.x[:, mesh.corners].mean(axis=2)
    assert not ((centre[0] > 1.001 * R) & (centre[1] > 1.001 * R)).any()
    assert size_of(mesh) == pytest.approx(3 * R**2, rel=1e-6)


def test_fields_end_at_boundaries_and_the_view_at_what_is_drawn():
    scene = Scene([Body(disc((0.0, 0.0), 1.0, spacing=0.2), GEL)], cell=0.25, walls=[Wall((0.0, -1.0), (0.0, 1.0))])
    axes = plot(scene, initial(scene), np.ones(scene.owner.size), label="one [1]")
    low = -1.0 - 0.08  # the wall is as thick as the margin
    assert np.allclose([*axes.get_xlim(), *axes.get_ylim()], [-1.04, 1.04, low, 1.04], atol=0.01)
    (field,) = drawn(axes, TriMesh)
    clip = field.get_clip_path().get_fully_transformed_path()
    assert not clip.contains_point(axes.transData.transform((0.8, 0.8)))
    assert clip.contains_point(axes.transData.transform((0.5, 0.5)))
    assert axes.child_axes[0].get_ylabel() == "one [1]"


def test_colours_are_those_of_the_values(squeezed):
    scene, (*_, state) = squeezed
    pressure = -0.5 * (state.stress[0, 0] + state.stress[1, 1])
    (mesh,) = drawn(plot(scene, state), TriMesh)
    assert np.array_equal(mesh.get_array()[: pressure.size], pressure)
    assert mesh.get_clim()[1] == pytest.approx(np.percentile(pressure, 99))
    (mesh,) = drawn(plot(scene, state, np.array([3.0, 5.0]), limits=(2.0, 6.0)), TriMesh)
    assert np.unique(mesh.get_array()).tolist() == [3.0, 5.0] and mesh.get_clim() == (2.0, 6.0)
    (mesh,) = drawn(plot(scene, state, "displacement"), TriMesh)
    moved = np.hypot(*(state.x - scene.initial_positions))
    assert np.array_equal(mesh.get_array()[: moved.size], moved) and mesh.get_clim()[0] == 0.0


def test_the_equivalent_stress_of_a_uniaxial_strain():
    """F = diag(1, 1.1): from the two principal stresses of the plane and the third, by the textbook formula."""
    scene = Scene([Body(box((0, 0), (R, R), spacing=R / 5), GEL)], cell=R / 4)
    state = initial(scene)
    F = np.zeros_like(state.F)
    F[0, 0], F[1, 1] = 1.0, 1.1
    stress = GEL.stress(F)  # first Piola-Kirchhoff; Cauchy is P F' / J
    sigma = np.einsum("ijn,kjn->ikn", stress, F) / 1.1
    state = type(state)(**{**vars(state), "F": F, "stress": sigma})
    a, b, c = sigma[0, 0, 0], sigma[1, 1, 0], GEL.stress_zz(F)[0]
    expected = np.sqrt(((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2) / 2.0)
    (mesh,) = drawn(plot(scene, state, "mises"), TriMesh)
    assert np.asarray(mesh.get_array()) == pytest.approx(np.full(mesh.get_array().size, expected), rel=1e-12)


def test_fringes_are_the_light_of_the_stress_difference():
    """Under a uniform stress all points have the same light, between them too; 1.25 orders give sin^2(1.25 pi)."""
    scene = Scene([Body(box((0, 0), (R, R), spacing=R / 5), GEL)], cell=R / 4)
    state = initial(scene)
    stress = np.zeros_like(state.stress)
    stress[0, 0], stress[0, 1], stress[1, 0] = 3e4, 2e4, 2e4  # s1 - s2 = sqrt(3^2 + 4^2) 1e4 Pa
    state = type(state)(**{**vars(state), "stress": stress})
    (mesh,) = drawn(plot(scene, state, "fringes", fringe=4e4), TriMesh)
    light = np.asarray(mesh.get_array())
    assert light == pytest.approx(np.full(light.size, np.sin(1.25 * np.pi) ** 2), rel=1e-9)
    assert mesh.get_clim() == (0.0, 1.0) and mesh.get_cmap().name == "gray"
    axes = plot(scene, state, "fringes", fringe=4e4)
    assert axes.child_axes[0].get_ylabel() == "light, a fringe for each 40 kPa"


def test_fringes_of_a_recording_are_those_of_its_states(squeezed, tmp_path):
    scene, (*_, state) = squeezed
    with record(tmp_path / "run.vtkhdf", scene) as series:
        series.write(state)
    (frame,) = read(tmp_path / "run.vtkhdf")
    recorded, seen = of_frame(frame), of_state(scene, state)
    known, given = recorded.fields["stress"]()[:2, :2], seen.fields["stress"]()
    np.testing.assert_allclose(known, given, rtol=1e-5, atol=1e-5 * np.abs(state.stress).max())
    assert recorded.cell() == pytest.approx(4.0 / 3.0 * R / 6, rel=0.1)
    assert animate([frame], tmp_path / "film.gif", colour="fringes", fringe=1e5, dpi=30).exists()


@given(st.integers(0, 50))
def test_divided_triangles_fill_the_whole_ones_with_linear_values(seed):
    x, gradient = np.random.default_rng(seed).normal(size=(2, 3)), np.random.default_rng(seed + 1).normal(size=(2, 2))
    place, corners, values = fringes.divided(x, np.array([[0, 1, 2]]), gradient @ x)
    (ax, ay), (bx, by) = (place[:, corners[:, k]] - place[:, corners[:, 0]] for k in (1, 2))
    areas, (sides, more) = ax * by - ay * bx, (x[:, k] - x[:, 0] for k in (1, 2))
    assert len(corners) == fringes.PARTS**2
    assert areas == pytest.approx(np.full(areas.size, (sides[0] * more[1] - sides[1] * more[0]) / areas.size))
    np.testing.assert_allclose(values, gradient @ place, atol=1e-12)


def test_signed_values_have_a_map_with_its_middle_at_zero(squeezed):
    scene, (*_, state) = squeezed
    (mesh,) = drawn(plot(scene, state, np.array([-1.0, 3.0]), label="displacement"), TriMesh)
    assert mesh.get_clim() == (-3.0, 3.0) and mesh.get_cmap().name == "RdBu_r"


def test_lines_are_as_wide_as_the_forces(squeezed):
    scene, (*_, state) = squeezed
    pairs, axes = network(scene, state), plot(scene, state, "body", forces=True)
    lines = drawn(axes, LineCollection)[-1]
    ratio = lines.get_linewidths() / pairs.force[0]
    assert pairs.size == 3 and ratio == pytest.approx(np.full(3, ratio[0]))
    centres = [np.average(state.x[:, scene.owner == b], axis=1, weights=state.mass[scene.owner == b]) for b in (0, 1)]
    between = int(np.flatnonzero((pairs.bodies >= 0).all(axis=0))[0])
    assert np.allclose(lines.get_segments()[between], centres)
    wall = int(np.flatnonzero(pairs.bodies[1] == -1)[0])
    assert np.allclose(lines.get_segments()[wall], [centres[0], pairs.centre[:, wall]])
    assert "normal force" in axes.get_legend().get_texts()[0].get_text()


def test_walls_are_drawn_where_they_are_now_and_end_at_each_other():
    scene = Scene(
        [Body(disc((2 * R, 2 * R), 1.6 * R, spacing=R / 4), GEL)], cell=R / 3,
        walls=[Wall((0, 0), (0, 1)), Wall((9, 4 * R), (0, -1), velocity=(0.0, -1.0)), Wall((0, 7), (1, 0)),
               Wall((4 * R, 0), (-1, 0))],
    )  # fmt: skip
    *_, state = simulate(scene, dt=1e-5, until=1e-4)
    walls = state.walls, state.wall_normals
    lines, of = wall_lines(*walls, view_of(state.x, *walls))
    top = 4 * R - 1e-4
    ends = [[(0, 0), (4 * R, 0)], [(0, top), (4 * R, top)], [(0, 0), (0, top)], [(4 * R, 0), (4 * R, top)]]
    assert of.tolist() == [0, 1, 2, 3]
    for line, expected in zip(lines, ends, strict=True):
        assert np.sort(line, axis=0) == pytest.approx(np.array(expected), abs=1e-12)
    drawn_lines, strips = drawn(plot(scene, state), LineCollection)[-1], drawn(plot(scene, state), PolyCollection)[0]
    assert len(drawn_lines.get_segments()) == 4
    centres = [np.asarray(path.vertices[:4]).mean(axis=0) for path in strips.get_paths()]
    middle = np.array([2 * R, top / 2])
    for line, centre in zip(lines, centres, strict=True):  # strips lie outside
        assert np.hypot(*(centre - middle)) > np.hypot(*(line.mean(axis=0) - middle))


def test_rigid_bodies_are_grey_and_points_without_outline_are_dots():
    other = disc((3 * R, 0.0), R, spacing=R / 4)
    bare = Points(other.x, other.volume)
    scene = Scene(
        [Body(disc((0, 0), R, spacing=R / 4), Rigid(1000.0), motion=(0.0, 0.0, 0.0)), Body(bare, GEL)], cell=R / 3,
        supports=[Support(lambda x: x[0] > 3.8 * R)],
    )  # fmt: skip
    state = initial(scene, scheme=Scheme(contact=contact.shared_grid, anchor=0.0))
    axes = plot(scene, state, "speed")
    shapes, dots = drawn(axes, PathCollection)
    assert len(shapes.get_paths()) == 1 and np.allclose(shapes.get_facecolors()[0], [0.72, 0.72, 0.72, 1.0])
    assert dots.get_offsets().shape == (bare.x.shape[1], 2)
    assert pytest.approx(state.x[:, scene.supported[0].points]) == np.asarray(axes.lines[0].get_xydata()).T


def test_ticks_show_multiples_of_the_units(squeezed):
    scene, (*_, state) = squeezed
    axes = plot(scene, state, limits=(0.0, 2e5), forces=True)
    assert axes.get_xlabel() == "x [mm]" and axes.xaxis.get_major_formatter()(2e-3, 0) == "2"
    bar = axes.child_axes[0]
    assert bar.get_ylabel() == "pressure [kPa]" and bar.yaxis.get_major_formatter()(5e4, 0) == "50"


@given(st.floats(1e-12, 1e12))
def test_multiples_of_units_lie_between_1_and_1000(size):
    scale, unit = prefixed("Pa", size)
    assert unit.endswith("Pa") and (1.0 - 1e-6 <= size / scale <= 1000.0 or unit in ("nPa", "GPa"))


@pytest.mark.parametrize(
    ("colour", "limits", "message"),
    [
        ("presure", None, "colour = 'presure'; use one of pressure, mises"),
        (np.zeros(7), None, r"array of float64 of shape \(7,\); give numbers by point \(\d+,\) or by body \(2,\)"),
        (np.zeros((2, 2)), None, r"of shape \(2, 2\)"),
        (np.array(["a", "b"]), None, "array of <U1"),
        (np.full(2, np.nan), None, "colour is nan or inf at every point; colour by another field"),
        ("body", (1.0, 1.0), r"limits = \(1.0, 1.0\); give two numbers, the lower one first"),
        ("body", 3.0, "limits = 3.0; give two numbers"),
    ],
)
def test_what_cannot_be_drawn_is_refused(squeezed, colour, limits, message):
    with pytest.raises(ValueError, match=message):
        plot(squeezed[0], squeezed[1][-1], colour, limits=limits)


def test_fringes_need_a_fringe_value_and_nothing_else_does(squeezed):
    scene, (*_, state) = squeezed
    for fringe in (None, 0.0, -1.0, np.nan, "2e5"):
        with pytest.raises(ValueError, match=r"fringe = .*; give the difference of principal stresses of one fringe"):
            plot(scene, state, "fringes", fringe=fringe)
    with pytest.raises(ValueError, match="colour = 'fringe'; use one of"):
        plot(scene, state, "fringe", fringe=1.0)
    with pytest.raises(ValueError, match=r"fringe = 1\.0 is for colour = 'fringes'; leave it out"):
        plot(scene, state, fringe=1.0)


def test_a_state_of_another_scene_is_refused(squeezed):
    scene = Scene([Body(disc((0, 0), R, spacing=R / 4), GEL)], cell=R / 3)
    with pytest.raises(SceneError, match="plot"):
        plot(scene, squeezed[1][-1])
    with pytest.raises(SceneError, match="animate"):
        animate(squeezed[1], "film.gif", scene=scene)


def test_a_film_has_a_frame_for_each_state_with_one_scale(squeezed, tmp_path):
    scene, states = squeezed
    film = animate(states, tmp_path / "film.gif", scene=scene, forces=True, dpi=40)
    with Image.open(film) as images:
        assert images.n_frames == len(states)
        first = np.asarray(images.convert("RGB"))
        images.seek(images.n_frames - 1)
        assert not np.array_equal(first, np.asarray(images.convert("RGB")))
    assert not pyplot.get_fignums()


def test_the_arrows_of_a_colour_bar_are_those_of_all_frames(squeezed):
    scene, states = squeezed
    style = partial(fields.style_of, forces=False, view=None, units=())
    pictures = [of_state(scene, state) for state in states]
    values = [fields.Field(np.full(scene.owner.size, value), "", "m", from_zero=True) for value in (3.0, 1.0)]
    assert style(pictures[:2], values[::-1], limits=(0.0, 2.0)).beyond == "max"
    assert style(pictures[:2], values, limits=(0.0, 2.0)).beyond == "max"
    assert style(pictures[:2], values, limits=(2.0, 4.0)).beyond == "min"
    assert style(pictures[:2], values, limits=(0.0, 3.0)).beyond == "neither"


def test_axes_stay_where_they_are_in_a_film(squeezed, tmp_path, monkeypatch):
    """A layout found anew for a frame may differ: 15 of 220 films of the same states had a frame that jumped."""
    scene, states = squeezed
    found = ConstrainedLayoutEngine.execute
    places, widths = [], iter([0.1, 0.2, 0.3, 0.4] * 10)

    def elsewhere(self, figure):
        found(self, figure)
        figure.axes[0].set_position([0.1, 0.1, next(widths), 0.5])

    grab = PillowWriter.grab_frame
    monkeypatch.setattr(ConstrainedLayoutEngine, "execute", elsewhere)
    monkeypatch.setattr(
        PillowWriter, "grab_frame", lambda self: (grab(self), places.append(self.fig.axes[0].get_position().bounds))
    )
    animate([*states] * 2, tmp_path / "film.gif", scene=scene, dpi=20)
    assert len(places) == 2 * len(states) and len(set(places)) == 1


def with_hole_and_support():
    """A ring pulled to the right by its left half, above a rigid block, between a wall and another far away."""
    block = box((-2 * R, -4 * R), (4 * R, 1.5 * R), spacing=R / 4)
    bodies = [Body(block, Rigid(1000.0), motion=(0.0, 0.0, 0.0)), Body(annulus(), GEL, velocity=(1.0, 0.0))]
    return Scene(bodies, cell=R / 4, supports=[Support(lambda x: x[0] < -1.5 * R, velocity=(1.0, 0.0))],
                 walls=[Wall((0, -4 * R), (0, 1)), Wall((0, 50 * R), (0, -1))])  # fmt: skip


def same_artists(axes, others):
    """Assert that curves, fields and lines of two axes have the same coordinates and values, to single precision."""
    for kind in (PathCollection, TriMesh, LineCollection, PolyCollection):
        for a, b in zip(drawn(axes, kind), drawn(others, kind), strict=True):
            for one, other in zip(a.get_paths(), b.get_paths(), strict=True):
                np.testing.assert_allclose(one.vertices, other.vertices, atol=1e-6 * R)
            if a.get_array() is not None:
                np.testing.assert_allclose(a.get_array(), b.get_array(), rtol=2e-6, atol=1e-6 * a.get_clim()[1])
            np.testing.assert_allclose(a.get_linewidths(), b.get_linewidths(), rtol=1e-6)
            np.testing.assert_array_equal(a.get_facecolors(), b.get_facecolors())
    for a, b in zip(axes.lines, others.lines, strict=True):
        np.testing.assert_array_equal(a.get_xydata(), b.get_xydata())
    assert axes.get_legend() is None or axes.get_legend().get_texts()[0].get_text() == (
        others.get_legend().get_texts()[0].get_text())  # fmt: skip


@pytest.mark.parametrize("colour", ["pressure", "mises", "displacement", "speed", "body"])
@pytest.mark.parametrize("build", ["squeezed", "with_hole_and_support"])
def test_a_recorded_frame_is_drawn_as_its_state(tmp_path, monkeypatch, request, build, colour):
    """Curves, triangles, values, walls, supports, forces: the same artists, from the file alone."""
    monkeypatch.setattr(sys.modules["skmpm.plot.snapshot"], "PARTS", 4)  # as recorded
    if build == "squeezed":
        scene, states = request.getfixturevalue(build)
        states = states[-3:]
    else:
        scene = with_hole_and_support()
        states = list(simulate(scene, dt=1e-5, until=3e-5))
    with record(tmp_path / "run.vtkhdf", scene) as file:
        for state in states:
            file.write(state)
    films = []
    for k, (frames, options) in enumerate([(states, {"scene": scene}), (read(tmp_path / "run.vtkhdf"), {})]):
        picture = pyplot.subplots()[1]
        monkeypatch.setattr(sys.modules["skmpm.plot.film"], "new_axes", lambda picture=picture: picture)
        animate(frames, tmp_path / f"{k}.gif", colour=colour, forces=True, dpi=20, **options)
        films.append(picture)
    same_artists(*films)
    np.testing.assert_allclose(films[0].get_xlim(), films[1].get_xlim())


def test_films_that_cannot_be_written_are_refused_before_anything_is_drawn(squeezed, tmp_path, monkeypatch):
    scene, states = squeezed
    monkeypatch.setattr(sys.modules["skmpm.plot.film"], "new_axes", lambda: pytest.fail("drawn"))
    with pytest.raises(ValueError, match="animate: there are no states"):
        animate([], tmp_path / "film.gif", scene=scene)
    with pytest.raises(ValueError, match=r"has the suffix '.avi'; use .mp4, .gif or .html"):
        animate(states, tmp_path / "film.avi", scene=scene)
    with pytest.raises(FileNotFoundError, match=r"the directory .*none does not exist"):
        animate(states, tmp_path / "none" / "film.gif", scene=scene)
    with pytest.raises(ValueError, match="animate: states need their scene; give scene="):
        animate(states, tmp_path / "film.gif")
    monkeypatch.setattr("matplotlib.animation.writers.is_available", lambda kind: False)
    with pytest.raises(ValueError, match=r"film.mp4 needs ffmpeg, which is not installed"):
        animate(states, tmp_path / "film.mp4", scene=scene)


def test_matplotlib_is_not_imported_with_the_library():
    code = "import sys, skmpm; sys.exit('matplotlib' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_without_matplotlib_the_remedy_is_named(squeezed, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.pyplot", None)
    with pytest.raises(ImportError, match=r'plot needs matplotlib; install it with: pip install "skmpm\[plot\]"'):
        plot(squeezed[0], squeezed[1][-1])


def test_frames_of_a_film_do_not_pile_up(tmp_path, monkeypatch):
    """What covers the images outside of a periodic box is drawn anew in every frame: it covered bodies in the end."""
    box = skmpm.Periodic(2.2, 2.2, rate=((0.1, 0.0), (0.0, 0.0)))
    scene = skmpm.Scene([skmpm.Body(skmpm.disc((1.1, 1.1), 1.0, spacing=0.3), GEL)], cell=0.4, periodic=box)
    states, patches = [skmpm.initial(scene)] * 3, []
    film = import_module("skmpm.plot.film")
    draw = film.draw
    monkeypatch.setattr(film, "draw", lambda axes, *given: (draw(axes, *given), patches.append(len(axes.patches))))
    skmpm.animate(states, tmp_path / "film.gif", scene=scene)
    assert patches[0] == patches[1] == patches[2] > 0
