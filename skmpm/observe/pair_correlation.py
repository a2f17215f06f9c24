"""`pair_correlation`: the radial distribution function of the centres of bodies."""

from __future__ import annotations

import reprlib

import numpy as np
from scipy.spatial import cKDTree

from skmpm.arrays import Array
from skmpm.observe.bodies import diameters
from skmpm.observe.regions import between_walls, contains
from skmpm.outline.images import heights, lattice_vectors
from skmpm.scene import Scene, SceneError, State, check_fits

DIAMETERS = 4.0  # mean diameters up to which the function is computed by default


def check_bins(name: str, bins: object, largest: object, remedy: str) -> None:
    """Raise SceneError unless `bins` is a positive integer and `largest` a positive number."""
    if not isinstance(bins, int | np.integer) or bins < 1:
        raise SceneError(f"{name}: bins = {reprlib.repr(bins)}; give a whole number, 1 or more")
    if not (isinstance(largest, int | float | np.number) and 0.0 < largest < np.inf):
        raise SceneError(f"{name}: largest = {reprlib.repr(largest)}; give {remedy}")


def pair_correlation(
    scene: Scene, state: State, *, bins: int = 80, largest: float | None = None
) -> tuple[Array, Array]:
    """Radial distribution function g of the centres of mass of the bodies that forces move.

    Parameters
    ----------
    scene, state : a scene and its state
    bins : number of rings
    largest : outer radius of the last ring [m]; by default four mean diameters

    Returns
    -------
    r : (bins,) root mean square radii of the rings [m]
    g : (bins,)

    Raises
    ------
    SceneError
        if `bins` or `largest` is no number above zero, no centre is that far from the walls, the walls do not enclose
        the bodies, or the state belongs to another scene

    Notes
    -----
    g(r) is the mean density of centres at the distance r from a centre, over their mean density: 1 without order. The
    mean is over the centres farther than `largest` from every wall, so no ring is cut by a wall; their number over
    the area of the region in which they lie is the mean density (Allen & Tildesley, Computer Simulation of Liquids).

    Examples
    --------
    >>> import skmpm
    >>> discs = skmpm.packing([1e-3] * 20, width=1e-2, solid_fraction=0.6, periodic=True)
    >>> material = skmpm.NeoHookean(E=1e6, nu=0.3, density=1000)
    >>> bodies = [skmpm.Body(skmpm.disc(x, 1e-3, spacing=5e-4), material) for x in discs.centres.T]
    >>> scene = skmpm.Scene(bodies, cell=1e-3, periodic=skmpm.Periodic(discs.width, discs.height))
    >>> r, g = skmpm.pair_correlation(scene, skmpm.initial(scene), bins=8, largest=4e-3)
    >>> r.shape, float(g[0])
    ((8,), 0.0)
    """
    check_fits(scene, state, "pair_correlation")
    remedy = f"a radius in metres above zero, or None for {DIAMETERS:g} mean diameters"
    check_bins("pair_correlation", bins, 1.0 if largest is None else largest, remedy)
    own = scene.grains
    if largest is None:
        largest = DIAMETERS * float(diameters(scene)[own].mean())
    centre, inner = state.centres[:, own], between_walls(state, largest)
    every = centre if state.box is None else _images(centre, state.box, largest)
    chosen = contains(inner, centre)
    if not (np.isfinite(inner.area) and chosen.any()):
        if not np.isfinite(between_walls(state).area):
            raise SceneError(
                "pair_correlation: no walls or periodic box close the region of the packing; it has no density"
            )
        raise SceneError(
            f"pair_correlation: no centre of a body is farther than largest = {largest:.3g} m from all walls; give a"
            " smaller one"
        )
    edges = np.linspace(0.0, largest, bins + 1)
    pairs = cKDTree(centre[:, chosen].T).sparse_distance_matrix(cKDTree(every.T), largest, output_type="ndarray")
    apart = pairs["v"][pairs["v"] > 0.0]
    references, rings = np.count_nonzero(chosen), np.pi * np.diff(edges**2)
    g = np.histogram(apart, edges)[0] * inner.area / (references**2 * rings)
    return np.sqrt(0.5 * (edges[1:] ** 2 + edges[:-1] ** 2)), g


def _images(centre: Array, box: Array, largest: float) -> Array:
    """The centres (2, n) [m] with all images that may be closer than `largest` [m] to one of them, (2, k)."""
    k = np.linalg.pinv(box) @ centre
    most = np.ceil(largest / heights(box) + np.ptp(k, axis=1)).astype(np.int64)
    shifts = box @ lattice_vectors(most)
    return np.asarray((centre[:, :, None] + shifts[:, None]).reshape(2, -1))
