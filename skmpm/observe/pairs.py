"""`network`: the contacts of a packing, merged to pairs of bodies."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from skmpm.arrays import Array, Ints
from skmpm.observe.contact_network import between, pairs_of, touching
from skmpm.observe.pair_correlation import check_bins
from skmpm.observe.sides import contact_lengths
from skmpm.optional import data_frame
from skmpm.representation import line, quantity
from skmpm.scene import Scene, State, check_fits, into_box


@dataclass(frozen=True, eq=False, repr=False)
class Network:
    """The contacts of a packing by pairs of bodies that touch; `network` makes it.

    A pair is two bodies, or a body and a wall. Its first body has the smaller index; walls are second. The tangent is
    t = (-n_y, n_x), as in `State.contacts`.

    Attributes
    ----------
    bodies : (2, k); walls are -1, -2, ...
    normal : (2, k) unit, from the second to the first body: mean of the normals, weighted by normal force
    force : (2, k) [N/m] on the first body, in (n, t), n positive in compression
    length : (k,) length of the boundary in contact [m]; nan for contacts at grid nodes
    centre : (2, k) [m] mean of the contact points, weighted by normal force
    image : (2, k) [m] displacement of the second body to its image in contact; zero but in a periodic box. `centre`
        and `normal` are where the first body is
    branch : (2, k) [m] from the centre of mass of the second body to that of the first; from or to `centre` for
        walls and bodies whose motion is prescribed
    friction : (k,) Coulomb coefficient
    mobilised_friction : (k,) ``|sum T| / (mu sum N)`` over the contacts of the pair, each in its own frame, 0 to 1;
        nan without friction or force, and with cohesion
    contacts : (k,) number of contacts merged

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> plates = [skmpm.Wall((0, -1e-3), (0, 1)), skmpm.Wall((0, 1e-3), (0, -1), velocity=(0, -0.1))]
    >>> scene = skmpm.Scene([body], cell=4e-4, walls=plates)
    >>> *_, state = skmpm.simulate(scene, dt=5e-4, until=1e-3, scheme=skmpm.Scheme(inertia=False))
    >>> pairs = skmpm.network(scene, state)
    >>> pairs.bodies.tolist()
    [[0, 0], [-1, -2]]
    >>> pairs.normal[1].round(2).tolist()
    [1.0, -1.0]
    >>> bool((pairs.force[0] > 0).all())
    True
    """

    bodies: Ints
    normal: Array
    force: Array
    length: Array
    centre: Array
    image: Array
    branch: Array
    friction: Array
    mobilised_friction: Array
    contacts: Ints

    @property
    def size(self) -> int:
        """Number of pairs."""
        return int(self.contacts.size)

    @property
    def force_xy(self) -> Array:
        """Force on the first body in x and y, (2, k) [N/m]."""
        n = self.normal
        return np.asarray(self.force[0] * n + self.force[1] * np.stack([-n[1], n[0]]))

    @property
    def fabric(self) -> Array:
        """Fabric tensor, the mean of n (x) n over the pairs, (2, 2), of trace 1; nan without pairs.

        Satake, Fabric tensor in granular materials, in: Vermeer & Luger (eds.), Deformation and Failure of Granular
        Materials, Balkema 1982, 63-68. Bodies with a single contact and walls are included.
        """
        n = self.normal
        return n @ n.T / self.size if self.size else np.full((2, 2), np.nan)

    def force_distribution(self, bins: int = 40, largest: float = 6.0) -> tuple[Array, Array]:
        """Probability density of normal forces over their mean, of pairs that press.

        Parameters
        ----------
        bins : number of bins
        largest : end of the last bin, in mean forces

        Returns
        -------
        f : (bins,) centres of the bins, between 0 and `largest`
        density : (bins,) its integral is the fraction of forces up to `largest`; nan without forces

        Raises
        ------
        SceneError
            if `bins` is not a whole number above zero, or `largest` not a number above zero

        Notes
        -----
        Radjai, Jean, Moreau & Roux, Phys. Rev. Lett. 77 (1996) 274.
        """
        check_bins("force_distribution", bins, largest, "a multiple of the mean force above zero")
        force, edges = self.force[0][self.force[0] > 0.0], np.linspace(0.0, largest, bins + 1)
        centre = 0.5 * (edges[1:] + edges[:-1])
        if force.size == 0:
            return centre, np.full(bins, np.nan)
        return centre, np.histogram(force / force.mean(), edges)[0] / (force.size * np.diff(edges))

    def __repr__(self) -> str:
        pressing = self.force[0][self.force[0] > 0.0]
        facts = {"pairs": self.size, "with walls": int((self.bodies[1] < 0).sum())}
        forces = {"mean": pressing.mean(), "largest": pressing.max()} if pressing.size else {}
        return line("Network", facts | {f"{name} normal force": quantity(f, "N/m") for name, f in forces.items()})

    to_pandas = data_frame

    def table(self) -> dict[str, NDArray[np.generic]]:
        """Columns (k,) by name, as `pandas.DataFrame` takes them."""
        vectors = {"normal": self.normal, "centre": self.centre, "branch": self.branch, "force": self.force_xy}
        parts = {f"{name}_{axis}": v[i] for name, v in vectors.items() for i, axis in enumerate("xy")}
        return {
            "first": self.bodies[0],
            "second": self.bodies[1],
            "normal_force": self.force[0],
            "tangential_force": self.force[1],
            "length": self.length,
            "friction": self.friction,
            "mobilised_friction": self.mobilised_friction,
            "contacts": self.contacts,
            **parts,
        }


def network(scene: Scene, state: State) -> Network:
    """Pairs of bodies in contact: the contacts of a state, merged.

    Bodies touch if a contact carries a force. If no contact does, as before the first step, they touch if a gap is
    below 0.02 cells; contacts at shared grid nodes have no gap and do not count then. Contacts of a body with itself
    are left out. The boundary of a pair that is in contact is measured as for `observe`.

    Parameters
    ----------
    scene, state : a scene and its state

    Returns
    -------
    the pairs, sorted by their first, then by their second body

    Raises
    ------
    SceneError
        if the state belongs to another scene

    Examples
    --------
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> plates = [skmpm.Wall((0, -1e-3), (0, 1)), skmpm.Wall((0, 1e-3), (0, -1), velocity=(0, -0.1))]
    >>> scene = skmpm.Scene([body], cell=4e-4, walls=plates)
    >>> *_, state = skmpm.simulate(scene, dt=5e-4, until=1e-3, scheme=skmpm.Scheme(inertia=False))
    >>> pairs = skmpm.network(scene, state)
    >>> pairs.bodies.tolist()
    [[0, 0], [-1, -2]]
    """
    check_fits(scene, state, "network")
    contacts, pairs = state.contacts, pairs_of(state.contacts, state.box)
    touch, of, n = touching(contacts, scene.cell) & between(contacts), pairs.of, pairs.bodies.shape[1]
    merged = np.bincount(of, touch, n)
    kept = np.flatnonzero(merged)

    def total(values: Array) -> Array:
        return np.array([np.bincount(of, row, n)[kept] for row in values], dtype=np.float64)

    bodies = pairs.bodies[:, kept]
    components, vectors = touch * contacts.force, touch * contacts.vectors
    pressing, sliding = total(components)
    # Contacts at points of the second body have the opposite normal and force, so the same components (n, t).
    sign, size = np.where(pairs.same, 1.0, -1.0), np.abs(components[0])
    weight = np.where(np.bincount(of, size, n)[of] > 0.0, size, touch)  # alike without normal forces
    normal, force = total(weight * sign * contacts.normal), total(sign * vectors)
    normal /= np.maximum(np.hypot(*normal), np.finfo(np.float64).tiny)
    centre = total(weight * np.where(sign > 0.0, contacts.at(0), contacts.at(1))) / total(weight[None])
    image = np.zeros_like(centre) if state.box is None else state.box @ pairs.lattice[:, kept]
    friction = scene.frictions.between(bodies)
    limit = np.where(scene.cohesion_between(bodies) > 0.0, 0.0, friction * pressing)
    return Network(
        bodies=bodies,
        normal=normal,
        force=np.stack([(normal * force).sum(axis=0), normal[0] * force[1] - normal[1] * force[0]]),
        length=total(contact_lengths(scene, state)[None])[0],
        centre=centre,
        image=image,
        branch=_ends(scene, state, bodies[0], centre) - _ends(scene, state, bodies[1], centre - image) - image,
        friction=friction,
        mobilised_friction=np.divide(np.abs(sliding), limit, out=np.full(limit.shape, np.nan), where=limit > 0.0),
        contacts=merged[kept].astype(np.int64),
    )


def force_lines(scene: Scene, state: State, pairs: Network) -> Array:
    """Lines (k, 2, 2) [m] along the branches of pairs, by which force chains are drawn.

    In a periodic box they begin where the first body is drawn, whose centre is brought into the box.
    """
    first = pairs.bodies[0]
    begin = _ends(scene, state, first, pairs.centre) + into_box(state.centres, state.box)[:, first]
    return np.stack([begin.T, (begin - pairs.branch).T], axis=1)


def _ends(scene: Scene, state: State, body: Ints, centre: Array) -> Array:
    """Ends of the branches at bodies (k,): their centres of mass, or `centre` (2, k) at what is prescribed.

    A box that is periodic in both directions has no outside: all bodies in it have their centres there.
    """
    own = (body >= 0) & scene.inside[np.maximum(body, 0)]
    return np.where(own, state.centres[:, np.maximum(body, 0)], centre)
