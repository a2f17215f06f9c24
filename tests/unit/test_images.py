"""Images of outlines in a periodic box: against all images by brute force."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skmpm import outline
from skmpm.outline.images import images, reduced, without_images
from skmpm.scene.contact_keys import ContactKeys, lattice_code
from skmpm.scene.periodic import recut

CIRCLE = 2.0 * np.pi * np.arange(12) / 12


def discs(centres, radii):
    loops = [[np.arange(12)] for _ in radii]
    outlines = outline.outlines(loops, 12 * np.arange(len(radii) + 1))
    x = [c[:, None] + r * np.stack([np.cos(CIRCLE), np.sin(CIRCLE)]) for c, r in zip(centres, radii, strict=True)]
    return outlines, np.concatenate(x, axis=1)


def meetings(centres, radii, box, reach):
    """Pairs (a, b, k), a <= b, of bodies whose bounding boxes come closer than `reach`, b at H k; one of k and -k."""
    found, n = set(), len(radii)
    for a in range(n):
        for b in range(a, n):
            for k in np.ndindex(13, 13):
                k = np.array(k) - 6
                if a == b and not k.any():
                    continue
                apart = np.abs(centres[a] - centres[b] - box @ k) - radii[a] - radii[b]
                if (apart < reach).all():
                    found.add((a, b, *k) if a < b or tuple(k) > (0, 0) else (a, b, *(-k)))
    return found


@given(
    seed=st.integers(0, 10**6),
    shear=st.floats(-1.4, 1.4),
    height=st.floats(0.3, 3.0),
    size=st.floats(0.05, 0.7),
    count=st.integers(1, 4),
)
@settings(max_examples=60, deadline=None)
def test_every_meeting_is_found_once(seed, shear, height, size, count):
    """Also of bodies larger than the box, far outside of it, and in slanted boxes."""
    rng = np.random.default_rng(seed)
    box = np.array([[1.0, shear * height], [0.0, height]])
    radii = rng.uniform(0.5 * size, size, count) * min(1.0, height)
    centres = (box @ rng.uniform(-2.0, 2.0, (2, count))).T
    outlines, x = discs(centres, radii)
    near = images(outlines, x, count, box, 0.05)
    moved = near.at(x, box)
    low, high = outline.overlaps.boxes(near.outlines, moved, near.body.size)
    found = []
    for i in range(near.body.size):
        for j in range(i + 1, near.body.size):
            if i < count and ((low[:, i] - high[:, j] < 0.05) & (low[:, j] - high[:, i] < 0.05)).all():
                (a, b), k = near.body[[i, j]].tolist(), near.between(np.array([i]), np.array([j]))[:, 0]
                if a > b:
                    a, b, k = b, a, -k
                found.append((a, b, *k) if a < b or tuple(k) > (0, 0) else (a, b, *(-k)))
    found = [tuple(int(v) for v in one) for one in found]
    assert len(found) == len(set(found))
    wanted = {tuple(int(v) for v in one) for one in meetings(centres, radii * np.cos(np.pi / 12), box, 0.05)}
    assert wanted <= set(found) <= {tuple(int(v) for v in one) for one in meetings(centres, radii, box, 0.05 + 1e-12)}


def test_images_are_where_the_lattice_puts_them():
    """Positions are those of the boundary points displaced by H k; topology is that of the bodies."""
    box = np.array([[1.0, 0.3], [0.0, 0.8]])
    outlines, x = discs(np.array([[0.95, 0.1], [3.2, -0.4]]), [0.4, 0.35])
    near = images(outlines, x, 2, box, 0.1)
    assert near.body.size > 2
    moved, b = near.at(x, box), near.outlines.body
    shift = moved - x[:, near.boundary]
    k = np.linalg.solve(box, shift)
    assert k == pytest.approx(near.lattice[:, b], abs=1e-12)
    assert np.array_equal(near.boundary[near.outlines.next], outlines.next[near.boundary])
    assert np.array_equal(near.boundary[near.outlines.previous], outlines.previous[near.boundary])
    assert np.array_equal(near.outlines.point, outlines.point[near.boundary])
    assert np.array_equal(near.owner, outlines.body[near.boundary])
    assert (np.diff(b) >= 0).all()


def test_overlap_across_an_edge_is_that_without_the_box():
    outlines, x = discs(np.array([[0.05, 0.5], [0.95, 0.5]]), [0.1, 0.1])
    near = images(outlines, x, 2, np.eye(2), 0.0)
    pairs, area = near.overlap(near.at(x, np.eye(2)))
    beside, y = discs(np.array([[0.05, 0.5], [-0.05, 0.5]]), [0.1, 0.1])
    _, exact = outline.overlap(beside, y, 2)
    assert pairs[:, area > 0.0].T.tolist() == [[0, 1]]
    assert area.sum() == pytest.approx(exact.sum(), rel=1e-12)


def test_without_a_box_nothing_is_copied():
    outlines, x = discs(np.array([[0.05, 0.5], [0.95, 0.5]]), [0.1, 0.1])
    near = images(outlines, x, 2, None, 0.1)
    assert near.none and near.outlines is outlines and near.at(x, None) is x
    assert without_images(outlines, 2).none


@given(st.floats(-30.0, 30.0), st.floats(0.05, 20.0))
@settings(max_examples=100, deadline=None)
def test_reduced_edges_are_the_shortest(shear, height):
    """The same lattice, of the same orientation, with edges at 60 degrees or more to each other."""
    box = np.array([[1.0, shear], [0.0, height]])
    change = reduced(box)
    assert round(np.linalg.det(change)) == 1
    a, b = (box @ change).T
    assert abs(a @ b) <= 0.5 * min(a @ a, b @ b) * (1.0 + 1e-9)
    upright, turn = recut(box)
    assert upright == pytest.approx(box @ turn)
    assert abs(upright[0, 1]) <= 0.5 + 1e-9 and np.array_equal(upright[:, 0], box[:, 0])


def test_keys_follow_a_box_that_is_cut_again():
    """Lattice vectors of the same contacts have the codes of T^-1 k; those of shifted points stay negative."""
    k = np.array([[0, 1, -1, 0, 1, -1], [0, 0, 1, -1, 1, -1]])
    turn, keys, points, sides = np.array([[1, -1], [0, 1]]), ContactKeys(25, 4, 2), np.arange(6), np.arange(6) % 4
    now = np.round(np.linalg.solve(turn, k)).astype(int)
    before, after = (keys.between(points, sides, lattice_code(v)) for v in (k, now))
    assert np.array_equal(keys.recut(before, turn), after)
    assert np.array_equal(keys.recut(-1 - before, turn), -1 - after)
    assert np.unique(lattice_code(k)).size == 6
