"""A step is a pure function: its arguments do not change, the derived data of a state included."""

import hashlib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import LinearOperator, SuperLU

from skmpm import (
    Body,
    LinearElastic,
    Load,
    NeoHookean,
    Rigid,
    Scene,
    Scheme,
    StepFailed,
    Support,
    Wall,
    box,
    disc,
    initial,
    linear,
    simulate,
    step,
)

R, CELL = 1e-3, 0.2e-3
LINEAR, SOFT = LinearElastic(1e6, 0.3, 1e3), NeoHookean(1e6, 0.3, 1e3)
OPAQUE = (LinearOperator, SuperLU)  # factors without arrays to look at
LEFT_OUT = {"seconds"}  # a time is never the same twice


def digest(value):
    """SHA-256 of all arrays and numbers within a value: fields of dataclasses, items of sequences and mappings."""
    found = hashlib.sha256()

    def add(value, name):
        found.update(f"{name} {type(value).__name__}".encode())
        if is_dataclass(value):
            value = {f.name: getattr(value, f.name) for f in fields(value)}
        elif sp.issparse(value):
            value = {part: getattr(value, part) for part in ("data", "indices", "indptr", "shape")}
        if isinstance(value, Mapping):
            value = {key: item for key, item in value.items() if key not in LEFT_OUT}
            found.update(str(list(value)).encode())
            for key, item in value.items():
                add(item, f"{name}.{key}")
        elif isinstance(value, list | tuple):
            for i, item in enumerate(value):
                add(item, f"{name}.{i}")
        elif isinstance(value, np.ndarray):
            found.update(f"{value.dtype.str} {value.shape} {value.strides}".encode() + value.tobytes())
        elif value is None or isinstance(value, bool | int | float | str | bytes | np.generic):
            found.update(repr(value).encode())
        else:
            assert callable(value) or isinstance(value, OPAQUE), f"no digest of {name}, a {type(value)}"

    add(value, "state")
    return found.hexdigest()


def frozen(value):
    """The value, all arrays within it made read-only, those that its cached properties keep included."""
    if isinstance(value, np.ndarray):
        value.setflags(write=False)
    elif sp.issparse(value):
        frozen([value.data, value.indices, value.indptr])
    elif is_dataclass(value):
        frozen(list(vars(value).values()))
    elif isinstance(value, list | tuple):
        for item in value:
            frozen(item)
    return value


def three(material, speed=2.0, **options):
    """Three discs fall on a floor, a lid behind them; none touches anything at first, so contacts spread."""
    v, places = (0.0, -speed), (1.02, 3.06, 5.08)
    discs = [Body(disc((0.0, y * R), R, spacing=R / 8), material, velocity=v) for y in places]
    walls = [Wall((0.0, 0.0), (0.0, 1.0)), Wall((0.0, 6.081 * R), (0.0, -1.0), velocity=v)]
    return Scene(discs, cell=CELL, walls=walls, friction=0.3, **options)


def driven(material, watch=lambda name, function: function):
    """A block on a support under a rigid disc, with a load, gravity and a wall: all that functions may prescribe.

    `watch(name, function)` may put another function in the place of each.
    """
    block = box((0.0, 0.0), (3.0 * R, 2.0 * R), spacing=R / 6)
    indenter = disc((1.5 * R, 2.5 * R), R / 2, spacing=R / 8)
    return Scene(
        [Body(block, material), Body(indenter, Rigid(1e3), motion=watch("rigid", lambda t: (0.0, -1.0 - t, 0.0)))],
        cell=0.3 * R,
        supports=[
            Support(
                lambda x: (x[1] < 0.1 * R) & (x[0] < 2.0 * R), velocity=watch("support", lambda t: (100.0 * t, None))
            )
        ],
        loads=[Load(lambda x: x[0] > 2.9 * R, watch("load", lambda t: (0.0, 1e3 * t)))],
        walls=[Wall((0.0, -0.01 * R), (0.0, 1.0), velocity=watch("wall", lambda t: (0.0, 10.0 * t)))],
        gravity=watch("gravity", lambda X, t: np.stack([0.0 * X[0], -9.81 + 0.0 * X[1]])),
        friction=0.3,
    )


CASES = {
    "linear": (three(LINEAR), Scheme(), 1e-5),
    "finite strain": (three(SOFT), Scheme(), 1e-5),
    "regridding": (three(LINEAR), Scheme(anchor=0.002), 1e-5),
    "shared nodes": (three(LINEAR), Scheme.nezamabadi2017(), 5e-6),
    "multigrid": (three(LINEAR), Scheme(linear=linear.amg), 1e-5),
    "sparse LU": (three(LINEAR), Scheme(linear=linear.direct), 1e-5),
    "without inertia": (three(LINEAR), Scheme(inertia=False), 1e-5),
    "driven": (driven(LINEAR), Scheme(), 1e-5),
    "driven without inertia": (driven(SOFT), Scheme(inertia=False), 1e-5),
}


@pytest.mark.parametrize("scene, scheme, dt", CASES.values(), ids=CASES)
def test_a_step_changes_nothing_that_it_is_given_and_leads_to_the_same_bits_again(scene, scheme, dt):
    """At every step of a run in which contacts spread, with body grids, factors and Delassus operators."""
    state, most = initial(scene, scheme=scheme), 0
    for _ in range(12):
        before, about = digest(state), digest(scene)
        after = step(scene, state, dt, scheme=scheme)
        assert digest(state) == before
        assert digest(scene) == about
        assert digest(step(scene, state, dt, scheme=scheme)) == digest(after)
        state, most = after, max(most, np.count_nonzero(after.contacts.force[0]))
    assert most > 1, "nothing touched"


@pytest.mark.nightly
@pytest.mark.parametrize("scene, scheme, dt", CASES.values(), ids=CASES)
def test_a_step_writes_into_no_array_that_it_is_given(scene, scheme, dt):
    """Not even to restore it afterwards: all arrays of scene and state are read-only.

    Loops are compiled again for such arrays, which takes minutes.
    """
    state = initial(frozen(scene), scheme=scheme)
    for _ in range(8):
        state = step(frozen(scene), frozen(state), dt, scheme=scheme)


def test_a_step_that_fails_changes_nothing_either():
    scene = three(LINEAR)
    state = initial(scene)
    for _ in range(5):
        state = step(scene, state, 1e-5)
    before = digest(state)
    with pytest.raises(StepFailed) as failure:
        step(scene, state, 1e-3)
    assert digest(state) == before == digest(failure.value.state)


def test_the_digest_sees_what_is_kept_for_speed():
    """Each of them changed alone: an array, a nested one, one of the body grids, what is known of contacts."""
    scene = three(LINEAR)
    state = step(scene, initial(scene), 1e-5)
    derived, grid = state.derived, state.derived.assembly.grid
    assembly = replace(derived.assembly, grid=replace(grid, cell=1.0))
    others = [
        replace(state, x=state.x + 1e-15),
        replace(state, contacts=replace(state.contacts, key=state.contacts.key + 1)),
        replace(state, derived=replace(derived, assembly=assembly)),
        replace(state, factored=replace(state.factored, points=~state.factored.points)),
    ]
    assert len({digest(each) for each in [state, *others]}) == 5


@pytest.mark.parametrize(
    "scheme, forces",
    [
        (Scheme(), [1.0]),
        (Scheme(theta=0.75), [0.75]),
        (Scheme(inertia=False), [0.0, 1.0]),
        (Scheme.nezamabadi2017(), [1.0]),
    ],
    ids=["dynamic", "theta", "without inertia", "shared nodes"],
)
def test_a_step_asks_once_per_time_level_for_all_that_is_prescribed(scheme, forces):
    """Velocities in the middle, by which things move; of rigid bodies also at the end, where points keep them.

    Forces at t + theta dt; without inertia also at t, for work is that of the mean of both. `forces` are their times
    in steps.
    """
    asked = {}

    def watch(name, function):
        def watched(*arguments):
            asked.setdefault(name, []).append(arguments[-1])
            return function(*arguments)

        return watched

    scene, dt = driven(LINEAR, watch), 5e-6
    state = initial(scene, scheme=scheme)
    for _ in range(3):
        asked.clear()
        after = step(scene, state, dt, scheme=scheme)
        middle = state.t + 0.5 * dt
        assert asked.pop("wall") == asked.pop("support") == [middle]
        assert asked.pop("rigid") == [middle, state.t + dt]
        for times in (asked.pop("load"), asked.pop("gravity")):
            assert sorted(times) == pytest.approx([state.t + share * dt for share in forces], rel=1e-12)
        state = after
    assert not asked and state.contacts.gap.size > 0


def test_how_contacts_respond_is_kept_only_with_the_factor_that_says_so():
    """That of a box which a support holds, not those of static steps with a metric, each of which has another."""
    boxes = [Body(box((-R, y), (2.0 * R, 2.0 * R), spacing=R / 7), LINEAR) for y in (0.0, 2.0 * R)]
    lid = Wall((0.0, 4.0 * R), (0.0, -1.0), velocity=(0.0, -4e-3 * R))
    scene, scheme = Scene(boxes, cell=CELL, walls=[Wall((0.0, 0.0), (0.0, 1.0)), lid]), Scheme(inertia=False)
    foot, low = Support(lambda x: x[1] < 1e-9), replace(lid, point=(0.0, 2.0 * R))
    for each, kept in ((scene, False), (replace(scene, bodies=boxes[:1], supports=[foot], walls=[low]), True)):
        state = step(each, initial(each, scheme=scheme), 5.0, scheme=scheme)
        assert (state.factored is not None and state.factored.points.any()) == kept


def test_functions_of_positions_may_work_in_place():
    """Those of supports, velocities and gravity got the arrays of the scene and moved its points."""

    def moved(x, *_):
        x -= R
        return np.zeros_like(x)

    def near(x):
        x -= R
        return np.hypot(*x) < 0.3 * R

    body = Body(disc((R, R), R, spacing=CELL), SOFT, velocity=moved)
    before = body.points.x.copy()
    scene = Scene([body], cell=CELL, supports=[Support(near)], gravity=moved)
    state = next(simulate(scene, until=1e-3))
    assert np.array_equal(scene.initial_positions, before) and np.array_equal(body.points.x, before)
    np.testing.assert_allclose(state.x, before, atol=1e-12 * R)
