"""Parts of one outline that face each other, and how deep an outline lies in itself."""

import numpy as np
import pytest

from skmpm import outline
from skmpm.outline.crossings import folded
from skmpm.outline.near import facing

ARMS = np.array([[0.0, 4.0, 4.0, 1.0, 1.0, 4.0, 4.0, 0.0], [0.0, 0.0, 1.0, 1.0, 1.5, 1.5, 3.0, 3.0]])


def divided(corners, parts):
    """A polygon with its sides divided into equal parts."""
    side = np.roll(corners, -1, axis=1) - corners
    return np.stack([corners + k / parts * side for k in range(parts)], axis=2).reshape(2, -1)


def one_body(*loops):
    """Outlines of one body, and positions."""
    x = np.concatenate(loops, axis=1)
    ends = np.cumsum([loop.shape[1] for loop in loops])
    return outline.outlines(
        [[np.arange(end - loop.shape[1], end) for loop, end in zip(loops, ends, strict=True)]], [0]
    ), x


BODY = np.array([0])


def test_the_arms_of_a_fork_face_each_other_over_the_gap_only():
    """Not through an arm, although both of its sides are as close; not around the end of the slot."""
    boundary, x = one_body(divided(ARMS, 12))
    c, j = facing(boundary, x, BODY, 1.1, 0.1)
    low, high = (x[:, c], 0.5 * (x[:, j] + x[:, boundary.next[j]]))
    assert c.size > 0
    within = np.sort(np.stack([low[1], high[1]]), axis=0)
    np.testing.assert_allclose(within, np.repeat([[1.0], [1.5]], c.size, axis=1))
    assert set(x[0, c[low[1] == 1.0]]) == set(x[0, (x[1] == 1.0) & (x[0] > 0.0)])
    assert facing(boundary, x, BODY, 0.49, 0.1)[0].size == 0
    assert facing(boundary, x, BODY[:0], 1.1, 0.1)[0].size == 0


def test_what_has_penetrated_by_less_than_the_depth_still_faces():
    moved = divided(ARMS, 12)
    moved[1, np.isclose(moved[1], 1.0)] += 0.6  # the lower arm reaches 0.1 into the upper one
    boundary, x = one_body(moved)
    flat = np.isclose(x[1], 1.6) & (x[0] > 1.5) & (x[0] < 3.5)
    for depth, found in ((0.09, False), (0.11, True)):
        c, _ = facing(boundary, x, BODY, 0.2, depth)
        assert np.isin(np.flatnonzero(flat), c).all() == found


def test_walls_of_a_hole_face_each_other_and_not_the_outer_boundary():
    square = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
    outer, hole = divided(square, 10), divided(0.2 * square[:, ::-1] + 0.1, 4)
    boundary, x = one_body(outer, hole)
    c, j = facing(boundary, x, BODY, 0.25, 0.05)
    assert c.size > 0
    assert (c >= 40).all()
    assert (j >= 40).all()
    assert folded(boundary, x).tolist() == [0]
    assert folded(*one_body(outer)).size == 0


@pytest.mark.parametrize("lift", [0.25, 0.6, 0.7])
def test_depth_of_an_arm_in_the_other(lift):
    """The tip of the lower arm is lifted into the upper one, beyond the slot of 0.5."""
    arms = ARMS + np.outer([-0.3, lift], [0, 0, 1, 0, 0, 0, 0, 0])
    boundary, x = one_body(divided(arms, 8))
    depth = outline.depth(boundary, x, 0)
    assert depth.max(initial=0.0) == pytest.approx(max(lift - 0.5, 0.0))
    assert (depth.size > 0) == (lift > 0.5) == (outline.crossings(boundary, x, BODY).size > 0)
