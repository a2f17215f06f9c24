"""What a prompt and a notebook show of an object: a line, and a small table."""

from dataclasses import replace

import numpy as np
import pytest

from skmpm import (
    Body,
    LinearElastic,
    NeoHookean,
    Scene,
    Scheme,
    Support,
    Wall,
    box,
    disc,
    initial,
    network,
    observe,
    step,
    suggest,
)
from skmpm.representation import prefixed, quantity

R = 1e-3


@pytest.fixture(scope="module")
def pressed():
    gel = NeoHookean(1e6, 0.45, 1000.0)
    bodies = [Body(disc((0.0, y * R), R, spacing=R / 8), gel) for y in (1.0, 3.0)]
    bodies.append(Body(box((3 * R, 0.0), (R, R), spacing=R / 4), LinearElastic(1e6, 0.3, 1000.0)))
    walls = [Wall((0.0, 0.0), (0.0, 1.0))]
    scene = Scene(bodies, cell=R / 4, walls=walls, friction=0.5, supports=[Support(lambda x: x[0] > 3.9 * R)])
    return scene, step(scene, initial(scene), 8e-6)


def test_scenes_states_and_reports_are_one_line(pressed):
    scene, state = pressed
    assert repr(scene) == (
        f"Scene(bodies 3 of LinearElastic, NeoHookean, points {state.x.shape[1]}, cell 250 µm, walls 1, supports 1,"
        " friction 0.5)"
    )
    assert repr(state).startswith(f"State(t = 8 µs, bodies 3, points {state.x.shape[1]}, contacts ")
    assert repr(state.report).startswith("Report(dt = 8 µs, Newton iterations ")
    for shown in (scene, state, state.report):
        assert len(repr(shown)) < 160 and "\n" not in repr(shown)


def test_arrays_are_shown_by_their_shapes(pressed):
    scene, state = pressed
    k = state.contacts.gap.size
    assert f"force=<float64 (2, {k})>" in repr(state.contacts)
    points = scene.bodies[2].points
    assert repr(points) == f"Points({points.size} points, 1 loops)"


def test_tables_of_notebooks_hold_the_same(pressed):
    scene, state = pressed
    for shown in (scene, state, state.report):
        table = shown._repr_html_()
        assert table.startswith("<table>") and table.count("<tr>") == table.count("</tr>") > 3
    assert "<td>cell</td><td>250 µm</td>" in scene._repr_html_() and "factorisation [s]" in state.report._repr_html_()


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [(8e-6, "s", "8 µs"), (0.0, "s", "0 s"), (12.0, "s", "12 s"), (1.234e6, "Pa", "1.23 MPa"), (2e-3, "m", "2 mm"),
     (9.996e-4, "m", "1 mm"), (-3e3, "N/m", "-3 kN/m"), (np.inf, "m", "inf m"), (5.0, "J/m", "5 J/m")],
)  # fmt: skip
def test_quantities_have_prefixes(value, unit, text):
    assert quantity(value, unit) == text


def test_multiples_of_lengths_and_times_stop_at_the_unit():
    assert prefixed("m", 5e4) == (1.0, "m") and prefixed("s", 7e3) == (1.0, "s")


def test_results_say_their_numbers(pressed):
    """By the numbers themselves: a prompt shows what a reader would look up."""
    scene = replace(pressed[0], gravity=(0.0, -9.81))
    state = step(scene, initial(scene), 8e-6)
    found, pairs = observe(scene, state), network(scene, state)
    on_walls = (pairs.bodies[1] < 0).sum()
    assert repr(pairs).startswith(f"Network(pairs {pairs.size}, with walls {on_walls}, mean normal force ")
    assert repr(pairs).endswith(f"largest normal force {quantity(pairs.force[0].max(), 'N/m')})")
    assert f"coordination {found.coordination:.3g}, " in repr(found) and len(repr(found)) < 250
    assert f"<td>contact_surface</td><td>{found.contact_surface:.4g}</td>" in found._repr_html_()
    assert repr(network(pressed[0], initial(pressed[0]))).endswith(")")


def test_a_scheme_shows_what_is_chosen():
    assert repr(Scheme()) == "Scheme()"
    chosen = Scheme.nezamabadi2017()
    assert repr(chosen) == "Scheme(anchor=0.0, contact=shared_grid, moment_fitting=False, mean_dilatation=False)"
    assert eval(repr(Scheme(inertia=False, newton_tol=1e-6))) == Scheme(inertia=False, newton_tol=1e-6)


def test_a_suggestion_is_one_line(pressed):
    found = suggest(pressed[0], error=0.05)
    assert repr(found) == (
        f"Suggestion({found.kind}, cell {quantity(found.cell, 'm')}, spacing {quantity(found.spacing, 'm')},"
        f" dt {quantity(found.dt, 's')})"
    )
