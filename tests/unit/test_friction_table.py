"""Friction by pairs of surfaces: the table, its precedence, what is refused, sliding with the value of a pair."""

import re
from dataclasses import replace

import numpy as np
import pytest

import skmpm
from skmpm.scene.friction import friction_of

R = 1e-3
GEL = skmpm.NeoHookean(E=1e5, nu=0.3, density=1000.0)
BLOCK = skmpm.box((0.0, 0.0), (R, R), spacing=R / 4)


def blocks(*objects, friction=0.0, walls=()):
    """A scene of blocks side by side with the given properties."""
    shifts = 2 * R * np.arange(len(objects))[:, None, None] * np.array([[1.0], [0.0]])
    bodies = [skmpm.Body(replace(BLOCK, x=BLOCK.x + d), GEL, **own) for d, own in zip(shifts, objects, strict=True)]
    return skmpm.Scene(bodies, cell=R / 2, walls=walls, friction=friction)


def floor(**own):
    return skmpm.Wall((0.0, 0.0), (0.0, 1.0), **own)


def between(scene, *pair):
    return float(scene.frictions.between(np.array(pair)[:, None])[0])


def test_number_holds_for_walls_too():
    scene = blocks({}, {}, friction=0.4, walls=[floor(), floor(friction=0.1)])
    assert [between(scene, 0, b) for b in (0, 1, -1, -2)] == [0.4, 0.4, 0.4, 0.1]


def test_table_holds_for_pairs_of_names_in_any_order():
    table = {("gel", "glass"): 0.3, ("gel", "gel"): 0.2, ("steel", "gel"): 0.6, "default": 0.1}
    scene = blocks(
        {"name": "gel"}, {"name": "gel"}, {"name": "steel"}, {}, friction=table, walls=[floor(), floor(name="glass")]
    )
    assert between(scene, 0, 1) == between(scene, 0, 0) == 0.2
    assert between(scene, 1, 2) == between(scene, 2, 1) == 0.6
    assert between(scene, 0, -2) == 0.3
    assert between(scene, 2, -2) == between(scene, 0, -1) == between(scene, 0, 3) == between(scene, 2, 2) == 0.1
    assert scene.frictions.largest == 0.6 and scene.frictions.largest_pair() == "bodies 0 and 2"


def test_entry_precedes_own_coefficient_and_that_the_default():
    table = {("gel", "glass"): 0.3, "default": 0.1}
    scene = blocks({"name": "gel", "friction": 0.5}, {}, friction=table, walls=[floor(name="glass", friction=0.7)])
    assert between(scene, 0, -1) == 0.3
    assert between(scene, 0, 1) == between(scene, 0, 0) == 0.5
    assert between(scene, 1, -1) == 0.7
    assert between(scene, 1, 1) == 0.1
    assert scene.frictions.largest_pair() == "body 1 and wall 0"


@pytest.mark.parametrize(
    ("objects", "walls", "friction", "message"),
    [
        (
            [{"friction": 0.2}],
            [{"friction": 0.3}],
            0.0,
            "body 0 gives friction = 0.2 and wall 0 0.3 for their contact",
        ),
        ([{"friction": 0.2}, {"friction": 0.3}], [], 0.0, "body 0 gives friction = 0.2 and body 1 0.3"),
        ([{"friction": -0.2}], [], 0.0, "body 0: friction = -0.2; give a Coulomb coefficient of zero or more"),
        ([{}], [{"friction": "rough"}], 0.0, "wall 0: friction = 'rough'"),
        ([{}], [{"friction": [0.1, 0.2]}], 0.0, "wall 0: friction = (0.1, 0.2); give a Coulomb coefficient"),
        ([{}], [], np.nan, "friction between bodies = nan"),
        ([{"name": 3}], [], 0.0, "body 0: name = 3; give text"),
        (
            [{"name": "gel"}],
            [],
            {("gel", "gell"): 0.2, "default": 0.0},
            "the name 'gell' of the table; names are 'gel'",
        ),
        ([{"name": "gel"}], [{}], {("gel", "gel"): 0.2}, "no entry for body 0 ('gel') and wall 0 and no 'default'"),
        ([{"name": "gel"}], [], {("gel", "gel"): -1.0}, "friction of ('gel', 'gel') = -1.0"),
        ([{"name": "gel"}], [], {"gel": 1.0}, "'gel' is not a pair of names"),
        ([{"name": "gel"}], [], {("gel",): 1.0}, "('gel',) is not a pair of names"),
        (
            [{"name": "a"}, {"name": "b"}],
            [],
            {("a", "b"): 0.1, ("b", "a"): 0.2, "default": 0.0},
            "friction of ('b', 'a') is given twice, as 0.1 and 0.2",
        ),
    ],
)
def test_wrong_friction_is_refused(objects, walls, friction, message):
    with pytest.raises(skmpm.SceneError, match=re.escape(message)):
        blocks(*objects, friction=friction, walls=[floor(**own) for own in walls])


def test_names_without_entries_cost_nothing():
    """Bodies of one coefficient are one surface, whatever their names: a packing has no table of its size."""
    scene = blocks(*({"name": f"grain {i}"} for i in range(4)), friction=0.3, walls=[floor(), floor()])
    assert friction_of(scene).coefficient.shape == (2, 2)


def test_table_of_one_value_gives_the_same_bits():
    """Two blocks that fall on a floor, with a number and with a table of that number."""
    scene = blocks({"name": "gel"}, {}, friction=0.3, walls=[floor()])
    scene = replace(scene, gravity=(2.0, -9.81))
    ends = []
    for friction in (0.3, {("gel", "gel"): 0.3, "default": 0.3}):
        *_, end = skmpm.simulate(replace(scene, friction=friction), dt=2e-5, until=2e-4)
        ends.append(end)
    assert np.array_equal(ends[0].x, ends[1].x) and np.array_equal(ends[0].contacts.force, ends[1].contacts.force)
    assert np.abs(ends[0].contacts.force[1]).max() > 0.0


def test_blocks_slide_with_the_coefficients_of_their_pairs():
    """On a plane inclined by 20 degrees a block accelerates with g (sin - mu cos), the rough one rests."""
    angle, g = np.deg2rad(20.0), 9.81
    table = {("ice", "plane"): 0.05, ("rubber", "plane"): 0.8, "default": 0.0}
    scene = blocks({"name": "ice"}, {"name": "rubber"}, {}, friction=table, walls=[floor(name="plane")])
    stiff = replace(GEL, E=1e7)
    scene = replace(
        scene,
        bodies=[replace(body, material=stiff) for body in scene.bodies],
        gravity=(g * np.sin(angle), -g * np.cos(angle)),
    )
    *_, end = skmpm.simulate(scene, dt=1e-4, until=5e-3)
    velocity = np.bincount(end.body, end.mass * end.v[0]) / np.bincount(end.body, end.mass)
    expected = g * (np.sin(angle) - np.array([0.05, 0.0, 0.0]) * np.cos(angle)) * end.t
    assert velocity[[0, 2]] == pytest.approx(expected[[0, 2]], rel=1e-6)
    assert abs(velocity[1]) < 1e-3 * expected[2]


def test_preflight_tells_where_friction_differs():
    walls = [floor()]
    for friction, own, text in (
        (0.4, {}, "friction 0.4\n"),
        (0.4, {"friction": 0.0}, "friction 0.4 between bodies, 0 at walls"),
        (0.0, {}, "frictionless"),
        ({("gel", "gel"): 0.2, "default": 0.4}, {}, "friction 0.2 to 0.4 between bodies, 0.4 at walls"),
    ):
        scene = blocks({"name": "gel"}, {}, friction=friction, walls=[replace(walls[0], **own)])
        assert text in str(skmpm.preflight(scene, dt=1e-5))
