"""Points are a quadrature rule: its moments against closed forms, its outline against the geometry."""

import re

import meshio
import numpy as np
import pytest
import skfem
from hypothesis import given
from hypothesis import strategies as st

from skmpm.points import Points, box, check, disc, from_mesh

SQUARE = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]])
LENGTH = st.floats(0.01, 100.0)
RATIO = st.floats(0.02, 3.0)  # spacing / size


def polygon_area(x):
    y = np.roll(x, -1, axis=1)
    return np.sum(x[0] * y[1] - x[1] * y[0]) / 2


def second_moments(points, centre):
    d = points.x - np.reshape(centre, (2, 1))
    return (points.volume * d) @ d.T


def rim_points(points):
    return np.sort(np.concatenate(points.outline))


def mesh_of(*blocks, points):
    return meshio.Mesh(np.asarray(points).T, [(kind, np.asarray(cells)) for kind, cells in blocks])


def meshed(mesh):
    kind = {3: "triangle", 4: "quad"}[mesh.t.shape[0]]
    return mesh_of((kind, mesh.t.T), points=mesh.p)


def mixed():
    """Rectangle [0, 4] x [0, 3]: quads on the left half, split into triangles on the right."""
    grid = skfem.MeshQuad.init_tensor(np.linspace(0, 4, 9), np.linspace(0, 3, 7))
    left = grid.p[0, grid.t].mean(axis=0) < 2
    quads, a = grid.t[:, left], grid.t[:, ~left]
    triangles = np.concatenate((a[[0, 1, 2]], a[[0, 2, 3]]), axis=1)
    return mesh_of(("quad", quads.T), ("triangle", triangles.T), points=grid.p)


def ring(kind):
    """Square [0, 7]^2 with the hole [2, 4] x [3, 5]; half of the cells clockwise."""
    grid = skfem.MeshQuad.init_tensor(np.arange(8.0), np.arange(8.0))
    (x, y) = grid.p[:, grid.t].mean(axis=1)
    t = grid.t[:, ~((x > 2) & (x < 4) & (y > 3) & (y < 5))]
    if kind == "triangle":
        t = np.concatenate((t[[0, 1, 2]], t[[0, 2, 3]]), axis=1)
    t[:, ::2] = t[::-1, ::2]
    return mesh_of((kind, t.T), points=grid.p)


@given(LENGTH, RATIO)
def test_disc_has_exact_area_centroid_and_second_moments(radius, ratio):
    centre = np.array((3.0, -2.0)) * radius
    points = disc(centre, radius, spacing=ratio * radius)
    assert check(points) is None
    assert points.volume.sum() == pytest.approx(np.pi * radius**2, rel=1e-13)
    assert points.x @ points.volume == pytest.approx(centre * np.pi * radius**2, rel=1e-12)
    exact = np.pi / 4 * radius**4
    np.testing.assert_allclose(second_moments(points, centre), exact * np.eye(2), atol=1e-12 * exact)


@given(LENGTH, RATIO)
def test_disc_outline_lies_on_the_circle_equally_spaced_and_counter_clockwise(radius, ratio):
    points = disc((0, 0), radius, spacing=ratio * radius)
    (boundary,) = points.outline
    x = points.x[:, boundary]
    assert boundary.size == max(8, round(2 * np.pi / ratio))
    np.testing.assert_allclose(np.hypot(*x), radius, rtol=1e-14)
    chord = np.linalg.norm(np.roll(x, -1, axis=1) - x, axis=0)
    np.testing.assert_allclose(chord, 2 * radius * np.sin(np.pi / boundary.size), rtol=1e-11)
    assert polygon_area(x) > 0
    inner = np.delete(points.x, boundary, axis=1)
    assert np.hypot(*inner).max() < radius * (1 - 1e-3)


def test_disc_outer_ring_is_radau():
    """The rule is exact for r too, which the mean radius of a ring would miss."""
    points = disc((0, 0), 1.0, spacing=0.25)
    ring = np.hypot(*points.x) > 0.75 + 1e-9
    first = (points.volume * np.hypot(*points.x))[ring].sum()
    assert first == pytest.approx(2 * np.pi / 3 * (1 - 0.75**3), rel=1e-13)


def test_disc_has_the_announced_number_of_points():
    assert 170 <= disc((0, 0), 0.95, spacing=0.14).size <= 200


def test_disc_points_are_evenly_spread():
    points = disc((0, 0), 1.0, spacing=0.1)
    inner = np.delete(points.volume, points.outline[0])
    assert inner.min() > 0.5 * 0.1**2
    assert inner.max() < 1.5 * 0.1**2


@given(LENGTH, LENGTH, RATIO)
def test_box_has_exact_area_and_first_moments(width, height, ratio):
    size = np.array((width, height))
    corner = np.array((-0.3, 2.0)) * size
    points = box(corner, size, spacing=max(ratio, 0.05) * size.max())
    area = width * height
    assert check(points) is None
    assert points.volume.sum() == pytest.approx(area, rel=1e-13)
    np.testing.assert_allclose(points.x @ points.volume, (corner + size / 2) * area, rtol=1e-12)


def test_box_rule_is_radau_at_the_ends():
    """Two intervals: quadratics are exact, which midpoints would miss by L h^2 / 12."""
    points = box((0, 0), (2.0, 2.0), spacing=1.0)
    assert points.size == 16
    np.testing.assert_allclose(second_moments(points, (0, 0)), 4 * np.array([[4 / 3, 1], [1, 4 / 3]]), rtol=1e-14)


@pytest.mark.parametrize("n", [3, 8, 20])
def test_second_moments_of_a_box_lack_those_of_its_midpoints(n):
    """A midpoint counts nothing for its interval's own: n - 2 of these, each L^2 / (12 n^2) of its length."""
    points = box((-1.0, -1.0), (2.0, 2.0), spacing=2.0 / n)
    assert (points.volume * points.x**2).sum(axis=1) == pytest.approx(4.0 / 3.0 * (1.0 - (n - 2) / n**3), rel=1e-12)


def test_box_outline_is_its_boundary():
    points = box((1, 2), (2.0, 1.0), spacing=0.3)
    (boundary,) = points.outline
    u = (points.x - np.array(((1,), (2,)))) / np.array(((2.0,), (1.0,)))
    on_rim = ((np.abs(u) < 1e-14) | (np.abs(u - 1) < 1e-14)).any(axis=0)
    np.testing.assert_array_equal(np.sort(boundary), np.flatnonzero(on_rim))
    assert polygon_area(points.x[:, boundary]) == pytest.approx(2.0, rel=1e-14)
    for corner in SQUARE.T:
        assert np.abs(u[:, boundary] - corner[:, None]).max(axis=0).min() < 1e-14


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda: disc((0, 0), -1.0, spacing=0.1), "radius"),
        (lambda: disc((0, 0), np.nan, spacing=0.1), "radius"),
        (lambda: disc((0, 0), 1.0, spacing=0.0), "spacing"),
        (lambda: disc((0, 0, 0), 1.0, spacing=0.1), "centre"),
        (lambda: disc((0, np.inf), 1.0, spacing=0.1), "centre"),
        (lambda: box((0, 0), (1, 0), spacing=0.1), "size"),
        (lambda: box((0, 0), 1.0, spacing=0.1), "size"),
        (lambda: box((0, np.nan), (1, 1), spacing=0.1), "corner"),
        (lambda: box((0, 0), (1, 1), spacing=[0.1, 0.2]), "spacing"),
        (lambda: disc((0, 0), None, spacing=0.1), "radius"),
        (lambda: disc((0, 0), 1.0, spacing="fine"), "spacing"),
    ],
)
def test_bad_arguments_are_named(make, name):
    with pytest.raises(ValueError, match=f"^{name} = .*; give"):
        make()


MESHES = {
    "triangles": lambda: meshed(skfem.MeshTri.init_lshaped().refined(2)),
    "quads": lambda: meshed(skfem.MeshQuad.init_tensor(np.linspace(0, 2, 6) ** 2, np.linspace(0, 1, 5))),
    "mixed": mixed,
    "triangles with a hole": lambda: ring("triangle"),
    "quads with a hole": lambda: ring("quad"),
    "one triangle": lambda: mesh_of(("triangle", [[0, 1, 2]]), points=SQUARE[:, :3]),
    "one general quad": lambda: mesh_of(("quad", [[0, 1, 2, 3]]), points=[[0, 1.3, 2, 0], [0, 0, 3, 1.1]]),
}


def exact_moments(mesh):
    """Area, first and second moments (about the origin) by a rule of scikit-fem of high order."""
    result = np.zeros((3, 3))
    for block in mesh.cells:
        kind = {"triangle": skfem.MeshTri, "quad": skfem.MeshQuad}[block.type]
        element = {"triangle": skfem.ElementTriP1(), "quad": skfem.ElementQuad1()}[block.type]
        basis = skfem.Basis(kind(mesh.points.T, block.data.T), element, intorder=6)
        f = np.array([np.ones_like(basis.dx), *basis.global_coordinates().value])
        result += np.einsum("ieq,jeq,eq->ij", f, f, basis.dx)
    return result


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("order", [0, 2, 3, 7])
@pytest.mark.filterwarnings("ignore:.*")  # scikit-fem on the clockwise cells, in the reference
def test_mesh_rule_is_exact_to_degree_two(name, order):
    mesh = MESHES[name]()
    points = from_mesh(mesh, order=order)
    f = np.array([np.ones(points.size), *points.x])
    np.testing.assert_allclose((points.volume * f) @ f.T, exact_moments(mesh), rtol=1e-13, atol=1e-13)
    assert points.volume.min() > 0
    assert check(points) is None


def round_mesh(edges, x_to_y=1.0):
    """Triangles round the centre of an ellipse."""
    angle = np.linspace(0.0, 2.0 * np.pi, edges, endpoint=False)
    rim = [x_to_y * np.cos(angle), np.sin(angle)]
    triangles = [[0, 1 + i, 1 + (i + 1) % edges] for i in range(edges)]
    return mesh_of(("triangle", triangles), points=np.concatenate([np.zeros((2, 1)), rim], axis=1))


@pytest.mark.parametrize(("edges", "x_to_y"), [(16, 1.0), (64, 1.0), (64, 1.5)])
def test_midpoints_of_a_round_mesh_lie_on_its_curve(edges, x_to_y):
    """Off the ellipse by a hundredth of what chords are; area and moments are the ellipse's, not the polygon's."""
    points = from_mesh(round_mesh(edges, x_to_y))
    (rim,) = points.outline
    off = np.hypot(points.x[0, rim] / x_to_y, points.x[1, rim]) - 1.0
    chord = 1.0 - np.cos(np.pi / edges)
    assert np.abs(off).max() < 0.03 * chord
    missing = 1.0 - points.volume.sum() / (np.pi * x_to_y)
    assert 0.0 < missing < 0.3 * (1.0 - np.sin(2.0 * np.pi / edges) / (2.0 * np.pi / edges))


@pytest.mark.parametrize("kind", ["triangle", "quad"])
@pytest.mark.parametrize("height", [0.87, 0.35, 0.15])
def test_flat_cells_at_a_round_hole_keep_their_volumes_positive(kind, height):
    """A hole of twelve edges in a layer of cells of `height` edges; midpoints of high ones are on it."""
    angle = 2.0 * np.pi * np.arange(12) / 12
    radii = 1.0 + 2.0 * np.sin(np.pi / 12) * height * np.array([0.0, 1.0, 3.0])
    nodes = np.concatenate([r * np.array([np.cos(angle), np.sin(angle)]) for r in radii], axis=1)
    inner = [(i + 12 * k, (i + 1) % 12 + 12 * k) for k in (0, 1) for i in range(12)]
    quads = [[b, a, a + 12, b + 12] for a, b in inner]
    cells = quads if kind == "quad" else [t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])]
    points = from_mesh(mesh_of((kind, cells), points=nodes))
    assert points.volume.min() > 0.0
    assert sum(polygon_area(points.x[:, loop]) for loop in points.outline) == pytest.approx(points.volume.sum())
    off = (1.0 - np.hypot(*points.x[:, points.outline[1][1::2]])) / (1.0 - np.cos(np.pi / 12))  # one on the chord
    assert (off > -0.06).all() and (off < (0.06 if height > 0.5 else 1.0)).all()


@pytest.mark.parametrize("edges", [3, 4, 6, 8, 10])
def test_midpoints_of_a_polygon_lie_on_its_sides(edges):
    points = from_mesh(round_mesh(edges))
    (rim,) = points.outline
    corners = points.x[:, rim[::2]]
    np.testing.assert_allclose(
        points.x[:, rim[1::2]], 0.5 * (corners + np.roll(corners, -1, axis=1)), rtol=0, atol=1e-15
    )


@pytest.mark.parametrize("name", [*MESHES, "round"])
def test_mesh_points_are_distinct_and_the_outline_encloses_the_area(name):
    points = from_mesh(round_mesh(64) if name == "round" else MESHES[name]())
    assert np.unique(points.x.round(12), axis=1).shape[1] == points.size
    area = sum(polygon_area(points.x[:, loop]) for loop in points.outline)
    assert area == pytest.approx(points.volume.sum(), rel=1e-13)


@pytest.mark.parametrize("kind", ["triangle", "quad"])
def test_hole_turns_clockwise_and_comes_last(kind):
    points = from_mesh(ring(kind))
    outer, hole = points.outline
    assert polygon_area(points.x[:, outer]) == pytest.approx(49.0, rel=1e-14)
    assert polygon_area(points.x[:, hole]) == pytest.approx(-4.0, rel=1e-14)
    assert outer.size == 2 * 28
    assert hole.size == 2 * 8


def test_outline_visits_corners_and_midpoints_in_turn():
    points = from_mesh(meshed(skfem.MeshQuad.init_tensor(np.arange(4.0), np.arange(3.0))))
    x = points.x[:, points.outline[0]]
    np.testing.assert_allclose(np.abs(np.roll(x, -1, axis=1) - x).sum(axis=0), 0.5)


def test_mesh_of_two_parts_has_two_outer_loops():
    one = skfem.MeshTri()
    both = mesh_of(
        ("triangle", np.concatenate((one.t, one.t + 4), axis=1).T),
        points=np.concatenate((one.p, one.p + np.array([[3], [0]])), axis=1),
    )
    points = from_mesh(both)
    assert [polygon_area(points.x[:, loop]) for loop in points.outline] == pytest.approx([1, 1])
    assert check(points) is None


def test_mesh_as_generators_write_it():
    """Third coordinate, lines and vertices among the cells, a node that no cell uses."""
    nodes = np.array([[9.0, 9, 0], [0, 0, 0], [1, 0, 0], [0, 1, 0]])
    cells = [("vertex", [[1]]), ("line", [[1, 2]]), ("triangle", [[1, 3, 2]])]
    points = from_mesh(meshio.Mesh(nodes, cells))
    assert points.size == 7
    np.testing.assert_allclose(np.sort(points.volume * 2), [0.05] * 3 + [2 / 15] * 3 + [0.45], rtol=1e-14)
    assert points.x.max() == 1


def test_numpy_2_0_0_returns_inverses_along_an_axis_with_two_dimensions(monkeypatch):
    unique = np.unique

    def of_2_0_0(x, axis=None, return_inverse=False, **options):
        found = unique(x, axis=axis, return_inverse=return_inverse, **options)
        if not return_inverse or axis is None:
            return found
        at = 1 + options.get("return_index", False)
        return (*found[:at], found[at].reshape(1, -1), *found[at + 1 :])

    expected = from_mesh(ring("quad"))
    monkeypatch.setattr(np, "unique", of_2_0_0)
    assert np.array_equal(from_mesh(ring("quad")).x, expected.x)


@pytest.mark.parametrize("kind", ["triangle6", "quad8", "quad9"])
def test_cells_of_second_order_count_by_their_corners(kind, caplog):
    """The same points as of the cells of first order, and the log says so once."""
    nodes = np.array([[0.0, 1, 1, 0, 0.5, 1, 0.5, 0, 0.5], [0.0, 0, 1, 1, 0, 0.5, 1, 0.5, 0.5]])
    cells = {
        "triangle6": [[0, 1, 3, 4, 8, 7], [1, 2, 3, 5, 6, 8]],
        "quad8": [[0, 1, 2, 3, 4, 5, 6, 7]],
        "quad9": [[0, 1, 2, 3, 4, 5, 6, 7, 8]],
    }[kind]
    corners = [cell[: 3 if kind == "triangle6" else 4] for cell in cells]
    points = from_mesh(mesh_of((kind, cells), points=nodes))
    assert [record.getMessage() for record in caplog.records] == [
        f"from_mesh takes the corners of cells of type {kind}"
    ]
    first = from_mesh(mesh_of((kind[:-1], corners), points=nodes))
    assert np.array_equal(points.x, first.x) and points.volume.sum() == pytest.approx(1.0, rel=1e-14)


@pytest.mark.parametrize("kind", [skfem.MeshTri, skfem.MeshQuad, skfem.MeshTri2, skfem.MeshQuad2])
def test_meshes_of_scikit_fem_are_taken_as_they_are(kind):
    """With their subdomains; an integer grid of 16 squares."""
    points = from_mesh(kind().refined(2).with_subdomains({"left": lambda x: x[0] < 0.5}))
    assert points.volume[points.group == "left"].sum() == pytest.approx(0.5, rel=1e-13)
    assert points.volume.sum() == pytest.approx(1.0, rel=1e-13)


TWO = [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize(
    ("mesh", "words"),
    [
        (mesh_of(("tetra", [[0, 1, 2, 3]]), points=SQUARE), "tetra"),
        (mesh_of(("triangle10", [[0, 1, 2, 3, 1, 2, 3, 0, 1, 2]]), points=SQUARE), "triangle10"),
        (mesh_of(("line", [[0, 1]]), points=SQUARE), "no cells"),
        (mesh_of(("triangle", TWO), points=[*SQUARE, [0, 0, 0, 1]]), "plane"),
        (mesh_of(("triangle", TWO), points=[SQUARE[0], [0, 0, np.nan, 1]]), "finite"),
        (mesh_of(("quad", [[0, 2, 1, 3]]), points=SQUARE), "folded"),
        (mesh_of(("triangle", [*TWO, [0, 2, 3]]), points=SQUARE), "overlap"),
        (
            mesh_of(("triangle", [[0, 1, 2], [3, 4, 5]]), points=[[0, 1, 1, 0, 1, 0], [0, 0, 1, 0, 1, 1]]),
            "merge",
        ),
        (
            mesh_of(("triangle", [[0, 1, 2], [0, 3, 4]]), points=[[0, 1, 1, -1, -1], [0, 0, 1, 0, -1]]),
            "one node",
        ),
    ],
)
def test_bad_meshes_are_refused(mesh, words):
    with pytest.raises(ValueError, match=words):
        from_mesh(mesh)


@pytest.mark.parametrize("order", [-1, 20])
def test_orders_without_a_rule_are_refused(order):
    with pytest.raises(ValueError, match=r"the mesh is a str; give a meshio.Mesh, as meshio.read\(path\)"):
        from_mesh("grain.msh")
    with pytest.raises(ValueError, match="order is"):
        from_mesh(MESHES["triangles"](), order=order)


GOOD = (SQUARE, np.ones(4) / 4)
RING = np.concatenate((SQUARE * 3, SQUARE + 1), axis=1)
EIGHT = np.array([[0, 1, 2, 2, 1, 0], [0, 1, 0, 2, 1, 2]], dtype=float)
ON_EDGE = np.array([[0, 2, 2, 1, 0], [0, 0, 2, 0, 2]], dtype=float)
SLIT = np.array([[0, 2, 2, 1, 2, 2, 0, 0], [0, 0, 1, 1, 1, 2, 2, 1]], dtype=float)
SHIFTED = np.concatenate((SQUARE * 3, SQUARE + 2.5), axis=1)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (Points(SQUARE.T, np.ones(4)), r"shape \(4, 2\)"),
        (Points(np.zeros((2, 0)), np.zeros(0)), "n > 0"),
        (Points(SQUARE, np.ones(3)), "one volume per point"),
        (Points(SQUARE * [[1], [np.nan]], np.ones(4)), "point 0 is not finite"),
        (Points(SQUARE, [1, 1, -2, 1]), "point 2 is -2"),
        (Points(SQUARE, [1, 1, 1, np.nan]), "point 3 is nan"),
        (Points(*GOOD, [[0, 1, 2, 4]]), "0 to 4; there are 4 points"),
        (Points(*GOOD, [[0, 1]]), "at least 3"),
        (Points(*GOOD, [0, 1, 2, 3]), r"shape \(\)"),
        (Points(*GOOD, [[0, 1, 2, 3, 0]]), "twice"),
        (Points(SQUARE[:, [0, 0, 1, 2]], np.ones(4), [[0, 1, 2, 3]]), "same position"),
        (Points(*GOOD, [[3, 2, 1, 0]]), "outer loop.*counter-clockwise"),
        (Points(*GOOD, [[0, 2, 1, 3]]), "crosses itself"),
        (Points(RING, np.ones(8), [[0, 1, 2, 3], [4, 5, 6, 7]]), "loop 1 is a hole.* clockwise"),
        (Points(SHIFTED, np.ones(8), [[0, 1, 2, 3], [7, 6, 5, 4]]), "loops 0 and 1 cross"),
        (Points(RING, np.ones(8), [[0, 1, 2, 3], [4, 5, 6, 7]]), "or keep it out of the others"),
        (Points(EIGHT, np.ones(6), [range(6)]), "touches itself: edges 0-1 and 4-5 .* move its parts apart"),
        (Points(ON_EDGE, np.ones(5), [range(5)]), "touches itself"),
        (Points(SLIT, np.ones(8), [range(8)]), "touches itself"),
    ],
)
def test_check_says_what_is_wrong(points, words):
    message = check(points)
    assert message is not None
    assert re.search(words, message), message


def test_check_accepts_good_points():
    assert check(Points(*GOOD)) is None
    assert check(Points(*GOOD, [[0, 1, 2, 3]])) is None
    assert check(Points(RING, np.ones(8), [[7, 6, 5, 4], [0, 1, 2, 3]])) is None


def test_points_are_converted_and_frozen():
    points = Points([[0, 1], [0, 1]], [1, 1], [[0, 1, 1]])
    assert points.size == 2
    assert points.x.dtype == points.volume.dtype == np.float64
    assert points.outline[0].dtype == np.int64
    named = Points(*GOOD, [[0.0, 1.0, 2.0, 3.0]], np.array(["a", "bc", "a", "a"], dtype=object))
    assert (
        named.outline[0].dtype == np.int64 and check(named) is None and named.group.tolist() == ["a", "bc", "a", "a"]
    )
    with pytest.raises(ValueError, match="whole numbers"):
        Points(*GOOD, [[0.0, 1.7, 2.0, 3.0]])
    with pytest.raises(AttributeError):
        points.x = points.x


def test_a_straight_boundary_at_any_angle_does_not_cross_itself():
    p = box((0, -0.5), (8, 1), spacing=0.0625)
    for angle in np.linspace(0.0, 3.0, 7):
        c, s = np.cos(angle), np.sin(angle)
        assert check(Points(np.array([[c, -s], [s, c]]) @ p.x + 3.0, p.volume, p.outline)) is None
