"""Invalid scenes are refused before any step, with the object, the value and the remedy."""

import pickle
import re

import meshio
import numpy as np
import pytest

import skmpm
from skmpm.io import CheckpointError, load
from skmpm.linear import Banded
from skmpm.material import LinearElastic, NeoHookean, Rigid
from skmpm.points import Points, box, disc, from_mesh
from skmpm.preflight import preflight
from skmpm.scene import Body, Load, Periodic, Pressure, Scene, SceneError, Spring, StepFailed, Support, Wall
from skmpm.scheme import Scheme
from skmpm.simulation import simulate
from skmpm.step.algorithm import step
from skmpm.step.initial_state import initial

R, CELL = 1.0, 0.4
GEL = NeoHookean(1e6, 0.3, 1000.0)
ROUND = disc((0.0, 0.0), R, spacing=0.4)
FINE = disc((0.0, 0.05), R, spacing=0.2)


def at(x, y=0.0, radius=R):
    return disc((x, y), radius, spacing=0.4)


def scene(points=ROUND, material=GEL, *, walls=(), others=(), cell=CELL, friction=0.0, gravity=(0, 0), **motion):
    return Scene(
        [Body(points, material, **motion), *others], cell=cell, walls=walls, friction=friction, gravity=gravity
    )


def wall(point=(0.0, -R), normal=(0.0, 1.0), **options):
    return scene(walls=[Wall((0.0, 9.0), (0.0, -1.0)), Wall(point, normal, **options)])


def pair(apart, overlap):
    """Two discs; the second is `apart` radii away."""
    return Scene([Body(ROUND, GEL), Body(at(apart * R), GEL)], cell=CELL, overlap=overlap)


def two_loops():
    return (*at(0).outline, *(loop + at(0).size for loop in at(0).outline))


def moved(points, index, value):
    x = points.x.copy()
    x[:, index] = value
    return Points(x, points.volume, points.outline)


BAD = {
    "modulus zero": (lambda: scene(material=NeoHookean(0.0, 0.3, 1.0)), "body 0.*modulus E = 0.0.*greater than zero"),
    "modulus negative": (lambda: scene(material=LinearElastic(-1e6, 0.3, 1.0)), "body 0.*E = -1000000.0.*greater"),
    "modulus text": (lambda: scene(material=NeoHookean("soft", 0.3, 1.0)), "body 0.*E = 'soft'.*modulus in Pa"),
    "modulus none": (lambda: scene(material=NeoHookean(None, 0.3, 1.0)), "body 0.*E = None.*modulus in Pa"),
    "Poisson 0.5": (lambda: scene(material=NeoHookean(1.0, 0.5, 1.0)), "body 0.*nu = 0.5.*between -1 and 0.5"),
    "Poisson -1": (lambda: scene(material=NeoHookean(1.0, -1.0, 1.0)), "body 0.*nu = -1.0.*between -1 and 0.5"),
    "Poisson nan": (lambda: scene(material=NeoHookean(1.0, np.nan, 1.0)), "body 0.*nu = nan.*between -1 and 0.5"),
    "density zero": (lambda: scene(material=NeoHookean(1.0, 0.3, 0.0)), "body 0.*density = 0.0.*kg/m3"),
    "density of Rigid": (lambda: scene(others=[Body(at(3), Rigid(-1.0))]), "body 1.*density = -1.0.*kg/m3"),
    "no material": (lambda: scene(material="gel"), "body 0.*material is 'gel'.*NeoHookean"),
    "a material's class": (lambda: scene(material=NeoHookean), "body 0.*material is <class.*NeoHookean"),
    "cell zero": (lambda: scene(cell=0.0), "cell = 0.0.*metres.*greater than zero"),
    "cell negative": (lambda: scene(cell=-0.1), "cell = -0.1.*greater than zero"),
    "cell nan": (lambda: scene(cell=np.nan), "cell = nan.*metres"),
    "cell none": (lambda: scene(cell=None), "cell = None.*metres"),
    "cell text": (lambda: scene(cell="fine"), "cell = 'fine'.*metres"),
    "cell pair": (lambda: scene(cell=(1.0, 1.0)), r"cell = \(1.0, 1.0\).*metres"),
    "two parts in one body": (
        lambda: scene(Points(np.hstack([at(0).x, at(3).x]), np.tile(at(0).volume, 2), two_loops())),
        "body 0: its outline has 2 outer loops; .*make a Body of each",
    ),
    "points stretched, volumes not": (
        lambda: scene(Points([[2.0], [1.0]] * ROUND.x, ROUND.volume, ROUND.outline)),
        "body 0: its points have a volume of 3.142 m2 in all, its outline bounds 6.*give volumes in m2",
    ),
    "no points": (lambda: scene(Points(np.zeros((2, 0)), np.zeros(0))), r"body 0.*\(2, 0\).*n > 0"),
    "points nan": (lambda: scene(moved(ROUND, 7, np.nan)), "body 0.*point 7 is not finite"),
    "points turned": (lambda: scene(Points(ROUND.x.T, ROUND.volume)), r"body 0.*components first"),
    "volumes missing": (lambda: scene(Points(ROUND.x, ROUND.volume[1:])), "body 0.*one volume per point"),
    "volume zero": (lambda: scene(Points(ROUND.x, 0.0 * ROUND.volume)), "body 0.*volume of point 0 is 0"),
    "no Points": (lambda: scene(ROUND.x), "body 0: its points are no skmpm.Points; make them by disc"),
    "clockwise outline": (
        lambda: scene(Points(ROUND.x, ROUND.volume, (ROUND.outline[0][::-1],))),
        "body 0.*outline loop 0.*counter-clockwise",
    ),
    "crossed outline": (lambda: scene(moved(ROUND, ROUND.outline[0][0], (-2.0, 0.1))), "body 0.*crosses itself"),
    "velocity nan": (lambda: scene(velocity=(0.0, np.nan)), r"body 0: velocity = \(0.0, nan\).*two finite numbers"),
    "velocity long": (lambda: scene(velocity=(0.0, 1.0, 2.0)), "body 0: velocity.*two finite numbers"),
    "velocity text": (lambda: scene(velocity="fast"), "body 0: velocity = 'fast'.*two finite numbers"),
    "velocity none": (lambda: scene(velocity=None), "body 0: velocity = None.*two finite numbers"),
    "velocity field short": (lambda: scene(velocity=lambda x: x[0]), r"body 0: velocity\(x\).*shape.*positions"),
    "velocity field inf": (
        lambda: scene(velocity=lambda x: x + np.inf),
        r"body 0: velocity\(x\) is \[inf inf\]",
    ),
    "velocity of Rigid": (
        lambda: scene(others=[Body(at(3), Rigid(1.0), velocity=lambda t: (t, 1.0))]),
        "body 1: velocity is a function, of a Rigid body; give its velocity at t = 0, or motion",
    ),
    "motion of Rigid": (
        lambda: scene(others=[Body(at(3), Rigid(1.0), motion=lambda t: (t, np.inf, 0.0))]),
        "body 1: motion at t = 0 s.*each a finite number or None",
    ),
    "spin nan": (lambda: scene(spin=np.nan), "body 0: spin = nan.*rad/s"),
    "spin text": (lambda: scene(spin="left"), "body 0: spin = 'left'.*rad/s"),
    "spin and motion": (
        lambda: scene(others=[Body(at(3), Rigid(1.0), spin=1.0, motion=(0, 0, 0))]),
        "body 1: spin = 1.0 and motion; give one of them",
    ),
    "gravity nan": (lambda: scene(gravity=(np.nan, 0.0)), "gravity.*nan.*two finite numbers"),
    "gravity scalar": (lambda: scene(gravity=-9.81), "gravity = -9.81.*two finite numbers"),
    "gravity field": (lambda: scene(gravity=lambda X, t: (0.0, -9.81)), r"gravity\(X, t\).*shape \(2,\).*positions"),
    "friction negative": (lambda: scene(friction=-0.1), "friction between bodies = -0.1.*zero or more"),
    "friction nan": (lambda: scene(friction=np.nan), "friction between bodies = nan.*zero or more"),
    "friction text": (lambda: scene(friction="rough"), "friction between bodies = 'rough'.*zero or more"),
    "wall friction": (lambda: wall(friction=-0.5), "wall 1: friction = -0.5.*zero or more"),
    "wall normal zero": (lambda: wall(normal=(0.0, 0.0)), "wall 1: normal.*length 0.*direction"),
    "wall normal none": (lambda: wall(normal=None), "wall 1: normal = None.*two finite"),
    "wall point nan": (lambda: wall(point=(0.0, np.nan)), "wall 1: point.*nan.*two finite"),
    "wall velocity inf": (lambda: wall(velocity=(0.0, np.inf)), "wall 1: velocity.*inf.*two finite"),
    "wall velocity f(t)": (lambda: wall(velocity=lambda t: 1.0), "wall 1: velocity at t = 0 s = 1.0.*two finite"),
    "wall cuts": (lambda: initial(wall(point=(0.0, -0.9 * R))), "wall 1 cuts body 0.*0.1 m behind.*move"),
    "no wall": (lambda: scene(walls=[(0.0, -1.0)]), "wall 0 is a tuple.*skmpm.Wall"),
    "walls alone": (lambda: scene(walls=Wall((0, -1), (0, 1))), "walls: expected a list, got a Wall"),
    "overlap": (
        lambda: scene(others=[Body(at(1.9 * R), GEL)]),
        r"bodies 0 and 1 overlap by 0\.\d+ m at the start; move them apart.*Scene\(overlap=",
    ),
    "a plate through a disc between its points": (
        lambda: scene(FINE, others=[Body(box((-11.0, -0.025), (25.0, 0.05), spacing=5.0), Rigid(1.0))]),
        "bodies 0 and 1 overlap by 0.01",
    ),
    "points beside their outline": (
        lambda: scene(
            Points(ROUND.x + [[2.0], [0.0]] * ~np.isin(range(ROUND.size), ROUND.outline), ROUND.volume, ROUND.outline)
        ),
        r"body 0: the centre of its points is 1\.[2-9]\d* m from that of the area in its outline",
    ),
    "overlap by more than is meant": (lambda: pair(1.95, 0.04), "overlap by 0.0[45].* at the start"),
    "overlap by more than a quarter of a cell": (
        lambda: pair(1.8, 0.3),
        "overlap = 0.3 m is 0.75 cells; give at most a quarter",
    ),
    "overlap negative": (lambda: pair(2.0, -1.0), "overlap = -1.0.*zero or more"),
    "the same place": (lambda: scene(others=[Body(ROUND, GEL)]), "bodies 0 and 1 overlap"),
    "one inside another": (lambda: scene(others=[Body(at(0.0, 0.0, 0.5), GEL)]), "bodies 0 and 1 overlap"),
    "no bodies": (lambda: Scene([], cell=CELL), "no bodies.*at least one"),
    "points as body": (lambda: Scene([ROUND], cell=CELL), "body 0 is a Points.*skmpm.Body"),
    "body alone": (lambda: Scene(Body(ROUND, GEL), cell=CELL), "bodies: expected a list, got a Body"),
    "all Rigid": (lambda: scene(material=Rigid(1.0)), "all 1 bodies are Rigid; give at least one of a deformable"),
}


FUNCTIONS = {
    "gravity(X, t)": lambda: scene(gravity=lambda X: X),
    "body 0: velocity(x)": lambda: scene(velocity=lambda: (0, 0)),
    "body 1: motion(t)": lambda: scene(others=[Body(at(3), Rigid(1.0), motion=lambda: (0, 0, 0))]),
    "wall 1: velocity(t)": lambda: wall(velocity=lambda: (0, 0)),
    "wall 1: force(t)": lambda: wall(force=lambda t, x: 1.0),
    "wall 1: pressure(t)": lambda: wall(pressure=lambda: 1.0),
    "support 0: where(x)": lambda: held(Support(lambda: True)),
    "support 0: velocity(t)": lambda: held(Support(lambda x: x[0] > 0, velocity=lambda: (0, 0))),
    "support 0: displacement(t)": lambda: held(Support(lambda x: x[0] > 0, displacement=lambda: (0, 0))),
    "load 0: where(x)": lambda: held(loads=[Load(lambda: True, (0, 0))]),
    "load 0: force(t)": lambda: held(loads=[Load(lambda x: x[0] > 0, lambda: (0, 0))]),
    "load 0: value(t)": lambda: held(loads=[Pressure(lambda x: x[0] > 0, lambda: 1.0)]),
    "spring 0: to(x)": lambda: held(springs=[Spring(lambda x: x[0] > 0, 1.0, to=lambda: True)]),
    "spring 0: rest(t)": lambda: held(springs=[Spring(lambda x: x[0] > 0, 1.0, rest=lambda: (0, 0))]),
    "periodic: rate(t)": lambda: held(periodic=Periodic(9.0, 9.0, rate=lambda: np.zeros((2, 2)))),
    "periodic: stress(t)": lambda: held(periodic=Periodic(9.0, 9.0, stress=lambda: np.zeros((2, 2)))),
}


def held(*supports, **options):
    return Scene([Body(ROUND, GEL)], cell=CELL, supports=supports, **options)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_of_other_arguments_are_refused(name):
    """The message has the arguments of both, before the function is called."""
    what, _, arguments = name.partition("(")
    with pytest.raises(
        SceneError, match=rf"^{what} takes the arguments \(.*\) and is called with \({re.escape(arguments)}; give a"
    ) as refused:
        FUNCTIONS[name]()
    turning = name.startswith("support") and arguments == "t)"
    assert str(refused.value).endswith("; to turn points, give `rotation`") == turning


@pytest.mark.parametrize(("make", "message"), BAD.values(), ids=BAD.keys())
def test_bad_input_raises_scene_error_naming_object_value_and_remedy_before_any_step(make, message):
    with pytest.raises(SceneError, match=message):
        make()


def test_the_same_scenes_without_their_fault_are_accepted():
    wall(point=(0.0, -R), friction=0.0, velocity=lambda t: (0.0, t))
    scene(
        others=[
            Body(at(2.0 * R), LinearElastic(1.0, -0.99, 1e-9)),
            Body(at(-2.0 * R), NeoHookean(1, 0.499, 7), spin=-3),
            Body(box((-1, 2), (2, 1), spacing=0.4), Rigid(1.0), motion=lambda t: (t, 1, 0)),
        ],
        walls=[Wall((0, 9), (0, -1))],
        velocity=lambda x: x,
        gravity=lambda X, t: 0.0 * X,
        friction=2,
    )


def test_bodies_may_touch_and_overlap_by_a_thousandth_of_a_cell_but_not_by_more():
    def squares(depth):
        edge = box((0.0, 0.0), (1.0, 1.0), spacing=0.4), box((1.0 - depth, 0.0), (1.0, 1.0), spacing=0.4)
        return Scene([Body(points, GEL) for points in edge], cell=CELL)

    squares(0.0)
    squares(1e-5 * CELL)
    with pytest.raises(SceneError, match="bodies 0 and 1 overlap"):
        squares(0.05 * CELL)
    initial(wall(point=(0.0, -R + 0.9e-3 * CELL)))
    for use in (initial, preflight):
        with pytest.raises(SceneError, match=r"wall 1 cuts body 0.*of a later stage begins in skmpm.continued"):
            use(wall(point=(0.0, -R + 2e-3 * CELL)))


@pytest.mark.parametrize(
    ("name", "acting"),
    [
        ("support 0: where", {"supports": [Support(lambda x: x[1] < -0.9 * R)]}),
        ("spring 0: where", {"springs": [Spring(lambda x: x[1] < -0.9 * R, 1e3)]}),
        ("spring 0: to", {"springs": [Spring(lambda x: x[0] < -0.8 * R, 1e3, to=lambda x: x[0] > 0.8 * R)]}),
        ("load 0: where", {"loads": [Pressure(lambda x: x[1] < np.inf, 1e3)]}),
    ],
)
def test_what_acts_on_deformable_bodies_alone_is_refused_at_free_rigid_ones(name, acting):
    """It acted on the deformable bodies without a word; held rigid bodies may be covered."""
    free = Body(at(3.0 * R), Rigid(1000.0))
    with pytest.raises(SceneError, match=f"{name} is true at points of body 1, a free rigid body.*leave that"):
        Scene([Body(ROUND, GEL), free], cell=CELL, **acting)
    held = Body(free.points, free.material, motion=(0.0, 0.0, 0.0))
    assert (Scene([Body(ROUND, GEL), held], cell=CELL, **acting).owner == [0] * ROUND.size + [1] * ROUND.size).all()


def test_walls_may_cut_rigid_bodies():
    floor = Body(box((-2, -2), (4, 1), spacing=0.4), Rigid(1.0), motion=(0.0, 0.0, 0.0))
    assert len(scene(others=[floor], walls=[Wall((0, -1.0), (0, 1))]).bodies) == 2


@pytest.mark.parametrize("walls", [(), (Wall((0, -R), (0, 1)),)])
def test_a_body_without_outline_needs_shared_nodes(walls):
    bare = Points(ROUND.x, ROUND.volume)
    with_others = scene(bare, walls=walls, others=() if walls else [Body(at(2.5), GEL)])
    for look in (initial, preflight):
        with pytest.raises(SceneError, match=r"body 0 has no outline.*shared_grid"):
            look(with_others)
    assert initial(with_others, scheme=Scheme.nezamabadi2017()).t == 0.0
    assert "shared grid" in str(preflight(with_others, 1e-3, scheme=Scheme.nezamabadi2017()))
    assert initial(scene(bare)).contacts.gap.size == 0  # alone it needs none
    assert "no outlines" in str(preflight(scene(bare)))


@pytest.mark.parametrize(
    ("late", "message"),
    [
        (
            {"walls": [Wall((0, -R), (0, 1), velocity=lambda t: (0, np.nan if t > 1e-3 else 0))]},
            "wall 0: velocity",
        ),
        (
            {"others": [Body(at(3), Rigid(1.0), motion=lambda t: (0,) if t > 1e-3 else (0, 0, 0))]},
            "body 1: motion",
        ),
        ({"gravity": lambda X, t: np.full(X.shape, np.inf if t > 1e-3 else 0.0)}, r"gravity\(X, t\) at t = 0.002 s"),
    ],
)
def test_functions_of_time_that_end_in_nothing_are_named_when_they_do(late, message):
    it = scene(material=LinearElastic(1e6, 0.3, 1000.0), **late)
    state = step(it, initial(it), 1e-3)
    with pytest.raises(SceneError, match=message):
        step(it, state, 1e-3)


def test_gravity_is_asked_for_where_forces_move_bodies_and_nowhere_else():
    """It passed at a free rigid body, until the first step; with chosen steps it was refused at held ones."""

    def beside(X, t):
        return np.where(X[0] > 2.0, np.nan, 0.0) * np.ones_like(X)

    with pytest.raises(SceneError, match=r"gravity\(X, t\) at t = 0 s is \[nan nan\]"):
        scene(others=[Body(at(3.5), Rigid(1000.0))], gravity=beside)
    held = scene(others=[Body(at(3.5), Rigid(1000.0), motion=(0.0, 0.0, 0.0))], gravity=beside)
    assert next(simulate(held, until=1e-4)).t > 0.0
    assert "chosen" in str(preflight(held))


def test_what_a_scene_knows_of_its_bodies():
    it = scene(
        others=[Body(box((2, 0), (1, 1), spacing=0.5), Rigid(1.0), motion=(0.0, 0.0, 0.0))],
        walls=[Wall((0, -R), (0, 1))],
    )
    assert it.offsets.tolist() == [0, ROUND.size, ROUND.size + 16]
    assert it.deformable.tolist() == [True, False]
    assert it.normals.tolist() == [[0.0], [1.0]]
    assert it.wall_velocities(3.0).tolist() == [[0.0, 0.0]]
    assert it.outlines.size == ROUND.outline[0].size + 12
    assert scene().wall_velocities(0.0).shape == (0, 2)
    assert scene().normals.shape == (2, 0)


def test_rigid_bodies_and_walls_have_no_unknowns():
    alone = initial(scene())
    rigid = Body(box((2, 0), (1, 1), spacing=0.1), Rigid(1.0), motion=(0.0, 0.0, 0.0))
    crowded = initial(scene(others=[rigid], walls=[Wall((0, -R), (0, 1))]))
    assert alone.displacement.size > 0
    assert crowded.displacement.size == alone.displacement.size
    assert crowded.derived.assembly.grid.nodes == alone.derived.assembly.grid.nodes
    factor = Scheme().linear(*_system(crowded))
    assert isinstance(factor, Banded)
    assert factor.blocks[-1] == 2 * alone.derived.assembly.grid.nodes


def _system(state):
    assembly = state.derived.assembly
    nothing = np.zeros((assembly.indices.size, 2, 2))
    return assembly.matrix(nothing, 0.0), assembly.grid.blocks, assembly.grid.rigid_motions


def test_cells_without_points_do_not_exist():
    """A ring has no cells in its hole; all cells hold a point, all points lie in their cell."""
    ring = Points(ROUND.x[:, -27:], ROUND.volume[-27:])
    grid = initial(scene(ring, cell=0.25)).derived.assembly.grid
    assert (np.bincount(grid.cell_of_point, minlength=grid.cells) > 0).all()
    lower = 0.25 * grid.cell_index[:, grid.cell_of_point]
    assert (lower <= ring.x + 1e-9).all()
    assert (ring.x <= lower + 0.25 + 1e-9).all()
    assert set(np.unique(grid.nodes_of_cell)) == set(range(grid.nodes))
    assert not ((grid.cell_index == [[0], [0]]).all(axis=0)).any()


@pytest.mark.parametrize("shape", [(2, 2), (3, 3), (2, 30), (6, 6)])
def test_an_outline_may_go_through_the_outermost_points_of_a_lattice(shape):
    """It bounds less than the points' volumes: half a spacing is missing all around."""
    nx, ny = shape
    x, y = np.meshgrid(np.arange(nx), np.arange(ny))
    number = np.arange(nx * ny).reshape(ny, nx)
    boundary = np.concatenate([number[0, :-1], number[:-1, -1], number[-1, :0:-1], number[:0:-1, 0]])
    Scene([Body(Points([x.ravel(), y.ravel()], np.ones(nx * ny), (boundary,)), GEL)], cell=2.0)


@pytest.mark.parametrize(
    "name", ["simulate", "initial", "step", "observe", "network", "preflight", "suggest", "plot", "record"]
)
def test_what_takes_a_scene_says_so(name, tmp_path):
    """Bodies instead of a scene: no attribute error from within."""
    scene = Scene([Body(disc((0.0, 0.0), 1.0, spacing=0.2), NeoHookean(1e6, 0.3, 1e3))], cell=0.25)
    state, call = initial(scene), getattr(skmpm, name)
    with pytest.raises(SceneError, match=rf"{name}: scene = \[Body\(.*; give a Scene"):
        if name == "record":
            with call(tmp_path / "run.vtkhdf", list(scene.bodies)):
                pass
        elif name in ("observe", "network", "plot"):
            call(list(scene.bodies), state)
        else:
            call(
                list(scene.bodies),
                **{"simulate": {"until": 1.0}, "step": {"state": state, "dt": 1.0}, "suggest": {"error": 0.1}}.get(
                    name, {}
                ),
            )


def test_functions_may_return_the_same_array_again():
    """With other values: two loads that write to one array had the force of the last, two walls its velocity."""
    shared = np.zeros(2)

    def writing(x, y):
        def value(t):
            shared[:] = x, y
            return shared

        return value

    walls = [
        Wall((0.0, -R), (0.0, 1.0), velocity=writing(1.0, 0.0)),
        Wall((0.0, R), (0.0, -1.0), velocity=writing(2.0, 0.5)),
    ]
    loads = [Load(lambda x: x[1] > 0.0, writing(1.0, 0.0)), Load(lambda x: x[1] > 0.0, writing(0.0, 5.0))]
    loaded = Scene([Body(ROUND, GEL)], cell=CELL, walls=walls, loads=loads)
    np.testing.assert_array_equal(loaded.forces(0.0), [[1.0, 0.0], [0.0, 5.0]])
    np.testing.assert_array_equal(loaded.wall_velocities(0.0), [[1.0, 0.0], [2.0, 0.5]])


@pytest.mark.parametrize("normal", [(0, 2), (1e-3, 1.0)])
def test_normals_of_walls_are_given_in_any_length(normal):
    """A disc falls on the wall: its state equals that with the unit normal, to the bit."""
    unit = tuple(np.array(normal) / np.hypot(*normal))
    falling = [scene(walls=[Wall((0.0, -1.02 * R), n)], velocity=(0.0, -1.0)) for n in (normal, unit)]
    given, expected = (step(each, initial(each), 0.05 * R) for each in falling)
    assert given.wall_force[0, 1] < 0.0
    assert np.array_equal(given.x, expected.x) and np.array_equal(given.wall_normals, expected.wall_normals)


@pytest.mark.parametrize("spacing", [0.4, 0.2])
def test_a_punch_with_fillets_lies_flush_on_a_slab(spacing):
    """Its smooth outline is straight up to where the fillets of radius 1 begin: gaps are zero along the flat face."""
    n, m = int(np.ceil(np.pi / 2 / spacing)), round(8.0 / spacing)
    angle = np.linspace(0.0, np.pi / 2, n + 1)
    arc = np.stack([4.0 + np.sin(angle), 1.0 - np.cos(angle)])
    flat = np.stack([np.linspace(-4.0, 4.0, m + 1), np.zeros(m + 1)])
    top = np.array([[5.0, -5.0], [5.0, 5.0]])
    loop = np.concatenate([flat, arc[:, 1:], top, arc[:, :0:-1] * [[-1.0], [1.0]]], axis=1)
    nodes, k = np.append(loop, [[0.0], [2.0]], axis=1), loop.shape[1]
    cells = np.stack([np.arange(k), (np.arange(k) + 1) % k, np.full(k, k)], axis=1)
    punch = from_mesh(meshio.Mesh(nodes.T, [("triangle", cells)]))
    slab = Body(box((-20.0, -4.0), (40.0, 4.0), spacing=spacing), GEL)
    both = Scene([slab, Body(punch, Rigid(1000.0), motion=(0.0, -1.0, 0.0))], cell=2 * spacing)
    contacts = initial(both, scheme=Scheme(inertia=False)).contacts
    under = np.abs(contacts.x[0]) < 4.0 + 1e-9
    assert under.sum() > 2.0 / spacing and np.abs(contacts.gap[under]).max() < 1e-6 * spacing


def test_what_is_written_to_arrays_and_lists_later_changes_nothing():
    v, g, rate, table = np.zeros(2), np.array([0.0, -9.81]), [[0.0, 1.0], [0.0, 0.0]], {("a", "b"): 0.1, "default": 0}
    one, other = Body(ROUND, GEL, velocity=v, name="a"), Body(at(3), GEL, name="b", spin=np.float32(2.0))
    below, above = Wall(np.array([0.0, -9.0]), [0, 1], velocity=v, force=None), Wall((0, 9), np.array([0.0, -1.0]))
    springs = [Spring(lambda x: x[0] > 0, stiffness=np.array([1.0, 2.0]))]
    made = Scene([one, other], cell=CELL, walls=[below, above], springs=springs, gravity=g, friction=table)
    sheared = Periodic(9.0, 9.0, rate=rate)
    v[:], g[:], rate[0][1], table["default"] = 1.0, 2.0, 3.0, 4.0
    springs.clear()
    assert made.gravity == (0.0, -9.81) and made.friction["default"] == 0
    assert one.velocity == below.velocity == (0.0, 0.0) and sheared.rate == ((0.0, 1.0), (0.0, 0.0))
    assert len(made.springs) == 1 and made.springs[0].stiffness == (1.0, 2.0)
    assert type(other.spin) is float
    assert Wall(np.zeros(2), np.array([0.0, 1.0])) == Wall((0, 0), (0, 1)) != below
    assert initial(made) != initial(made)  # states are compared as objects


def test_errors_that_are_pickled_keep_their_text_and_attributes():
    """As between processes. StepFailed carries a state, CheckpointError is made of three texts."""
    pulled = Scene([Body(ROUND, GEL)], cell=CELL, loads=[Load(lambda x: x[1] > 0, (0, 1e3))])
    with pytest.raises(StepFailed) as failed:
        step(pulled, initial(pulled), 1.0, scheme=Scheme(max_newton=1))
    with pytest.raises(CheckpointError) as unreadable:
        load(__file__)
    again, other = (pickle.loads(pickle.dumps(each.value)) for each in (failed, unreadable))
    assert str(again) == str(failed.value) and again.problem == failed.value.problem and again.retryable
    np.testing.assert_array_equal(again.state.x, failed.value.state.x)
    assert type(other) is CheckpointError and str(other) == str(unreadable.value)


def test_time_is_a_float_whatever_the_type_of_dt():
    state = step(scene(), initial(scene()), np.float32(0.125))
    assert type(state.t) is float and state.t == 0.125


def test_what_is_prescribed_may_begin_at_zero_but_for_round_off():
    almost = 1e-5 * np.sin(np.pi * 1.0)  # 1e-21
    Scene([Body(ROUND, GEL)], cell=CELL, supports=[
        Support(lambda x: x[0] > 0.9, displacement=lambda t: (almost, 0.0)),
        Support(lambda x: x[0] < -0.9, rotation=lambda t: almost),
    ])  # fmt: skip
