"""Steps in contact that begin with the factor of an earlier step."""

import gc
from dataclasses import replace

import numpy as np
import pytest

from skmpm import Body, LinearElastic, NeoHookean, Scene, Scheme, Wall, disc, initial, load, save, step
from skmpm.step import equations, factor

R, DT = 1e-3, 1e-5
SOFT = NeoHookean(1e7, 0.45, 1000.0)


def squeezed(material=SOFT):
    """A disc between a floor and a lid that moves by a 25th of a cell in a step."""
    walls = [Wall((0.0, -R), (0.0, 1.0)), Wall((0.0, R), (0.0, -1.0), velocity=(0.0, -1.0))]
    return Scene([Body(disc((0.0, 0.0), R, spacing=R / 6), material)], cell=R / 4, walls=walls, friction=0.5)


def run(scene, state, steps):
    states = []
    for _ in range(steps):
        state = step(scene, state, DT)
        states.append(state)
    return states


@pytest.fixture(autouse=True)
def large(monkeypatch):
    """A disc counts as a large problem, of which factors are kept."""
    monkeypatch.setattr(equations, "LARGE", 0)


def in_memory():
    gc.collect()
    return len(factor._factors)


def test_few_steps_factorise_and_all_lead_where_factors_of_their_own_do():
    scene = squeezed()
    states = run(scene, initial(scene), 20)
    assert sum(state.report.factorisations for state in states) <= 4
    tight = Scheme(newton_tol=1e-9, gap_tol=1e-6)
    with_kept, own = (
        step(scene, replace(states[9], **given), DT, scheme=tight) for given in ({}, {"factored": None})
    )
    assert own.report.factorisations > 0
    np.testing.assert_allclose(with_kept.x, own.x, rtol=0.0, atol=1e-8 * R)


def test_a_run_from_a_file_has_the_bits_of_one_with_the_factor_in_memory(tmp_path):
    """The factor is older than the state, which has what it follows from."""
    scene = squeezed()
    *_, state = run(scene, initial(scene), 10)
    save(tmp_path / "state", state)
    went_on, began = run(scene, state, 5), run(scene, load(tmp_path / "state"), 5)
    assert went_on[0].report.factorisations == 0
    assert all(
        np.array_equal(a.x, b.x) and np.array_equal(a.stress, b.stress) for a, b in zip(went_on, began, strict=True)
    )


def test_runs_side_by_side_have_the_bits_of_each_alone():
    """And the factor of each is in memory once, however many states are kept."""
    scenes = squeezed(), squeezed(NeoHookean(5e6, 0.3, 1000.0))
    before = in_memory()
    alone = [run(scene, initial(scene), 8) for scene in scenes]
    assert in_memory() == before + 2
    states = [initial(scene) for scene in scenes]
    for _ in range(8):
        states = [step(scene, state, DT) for scene, state in zip(scenes, states, strict=True)]
    assert all(np.array_equal(a[-1].x, b.x) for a, b in zip(alone, states, strict=True))
    del alone, states
    assert in_memory() == before


def test_a_step_with_other_threads_uses_the_factor_in_memory(monkeypatch):
    scene, made = squeezed(), []
    *_, state = run(scene, initial(scene), 10)
    monkeypatch.setattr(factor, "factorise", lambda *_, **__: made.append(0))
    after = step(scene, state, DT, scheme=Scheme(threads=1))
    assert after.t > state.t and not made


def test_of_small_problems_every_step_has_a_factor_of_its_own(monkeypatch):
    monkeypatch.undo()
    scene = squeezed()
    assert all(state.report.factorisations > 0 and state.factored is None for state in run(scene, initial(scene), 5))


@pytest.mark.parametrize("scheme, dt", [(Scheme(), 2 * DT), (Scheme(inertia=False), DT), (Scheme(theta=0.5), DT)])
def test_other_steps_do_not_depend_on_what_is_in_memory(scheme, dt):
    """Of another length or scheme: first when the factor is in memory, and once more when it is not."""
    for material in (SOFT, LinearElastic(1e7, 0.45, 1000.0)):
        scene = squeezed(material)
        *_, state = run(scene, initial(scene), 6)
        first, again = (step(scene, state, dt, scheme=scheme) for _ in range(2))
        assert np.array_equal(first.x, again.x)
        assert first.report.factorisations == again.report.factorisations


def test_a_factor_of_another_step_length_leaves_the_memory():
    """States are kept, of which each had its own."""
    scene, before, states = squeezed(), in_memory(), []
    state = initial(scene)
    for k in range(6):
        state = step(scene, state, (1.0 + 0.1 * k) * DT)
        states.append(state)
    assert in_memory() == before + 1
