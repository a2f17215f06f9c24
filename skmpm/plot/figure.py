"""`plot`: a picture of a state."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from skmpm.optional import optional
from skmpm.plot.bodies import draw_bodies
from skmpm.plot.fields import (
    Field,
    Limits,
    Style,
    View,
    field_of,
    in_multiples,
    scale_of,
    style_of,
)
from skmpm.plot.snapshot import Snapshot, of_state
from skmpm.plot.surroundings import add_key, draw_box, draw_forces, draw_supports, draw_walls, offsets
from skmpm.representation import prefixed
from skmpm.scene import Scene, State, check_fits

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BAR = 0.8  # [inches] of a colour bar with its label


def plot(
    scene: Scene,
    state: State,
    colour: str | NDArray[np.floating] = "pressure",
    *,
    forces: bool = False,
    axes: Axes | None = None,
    limits: Limits | None = None,
    view: View | None = None,
    units: Sequence[str] = (),
    legend: bool = True,
    label: str = "",
    fringe: float | None = None,
) -> Axes:
    """Draw the bodies of a state, filled by a field, with walls and supports.

    Boundaries are the smooth curves on which contact acts. Fields are linear between material points. A periodic box
    is drawn with what lies in it, and images around it are faded.

    Parameters
    ----------
    scene, state : a scene and its state
    colour : "pressure" or "mises" [Pa], both of elastic stress, without what viscosity adds; "displacement" since
        t = 0 [m], "speed" [m/s], "plastic strain" (equivalent, of materials that yield), "fringes", "body", or an
        array by point (n,) or by body (bodies,)
    forces : draw the contact network: lines between the centres of bodies that touch, or from a centre to a wall, as
        wide as their normal force
    axes : axes to draw into; by default those of a new figure
    limits : ends of the colour scale, in SI units; by default the range of the values without 1 % at each end: from
        zero for magnitudes and where little of it is negative, symmetric about zero where it has both signs
    view : rectangle that is shown, ((left, right), (lower, upper)) [m]; by default all bodies and the walls near them
    units : multiples of units on axes and legends, as ("mm", "kPa"); by default those that suit the values
    legend : add a colour bar and, with forces, a key of their lines
    label : label of the colour bar of an array, with the unit in which its values are
    fringe : difference of the principal stresses in the plane that makes one of the "fringes" [Pa]: those of a
        photoelastic experiment between crossed circular polarisers, dark where the difference is a multiple of it

    Returns
    -------
    the axes, in metres; their ticks and the colour bar show multiples of the units

    Raises
    ------
    ImportError
        if matplotlib is not installed
    ValueError
        if colour is no name or array of these shapes, fringes have no fringe value, limits or a range of the view are
        not two ascending numbers, or a unit is no multiple
    SceneError
        if the state belongs to another scene

    Examples
    --------
    >>> from matplotlib import pyplot
    >>> import skmpm
    >>> body = skmpm.Body(skmpm.disc((0, 0), 1e-3, spacing=2e-4), skmpm.NeoHookean(E=1e6, nu=0.3, density=1000))
    >>> floor = skmpm.Wall((0, -1e-3), (0, 1))
    >>> scene = skmpm.Scene([body], cell=4e-4, walls=[floor], gravity=(0, -9.81))
    >>> axes = skmpm.plot(scene, skmpm.initial(scene), "speed")
    >>> axes.get_aspect()
    1.0
    >>> pyplot.close(axes.figure)
    """
    check_fits(scene, state, "plot")
    seen = of_state(scene, state)
    field = field_of(seen, colour, label, fringe)
    style = style_of([seen], [field], forces=forces, limits=limits, view=view, units=units)
    axes = new_axes() if axes is None else axes
    draw(axes, seen, field, style)
    if legend:
        add_legend(axes, seen, field, style)
    return axes


def new_axes() -> Axes:
    """Axes of a new figure."""
    axes: Axes = matplotlib_module("pyplot").subplots(layout="constrained")[1]
    return axes


def matplotlib_module(name: str) -> Any:
    """A module of matplotlib; ImportError, with the remedy, if it is not installed."""
    return optional(f"matplotlib.{name}", "plot", "plot")


def draw(axes: Axes, seen: Snapshot, field: Field, style: Style) -> None:
    """Draw bodies, walls, supports and forces into axes, without a legend."""
    draw_walls(axes, seen, style.view)
    for offset in offsets(seen, style.view):
        draw_bodies(axes, seen, field, style, offset)
        if style.largest_force is not None:
            draw_forces(axes, seen, style.largest_force, offset)
    draw_supports(axes, seen)
    draw_box(axes, seen, style.view)
    axes.set_aspect("equal")
    (left, low), (right, high) = style.view.tolist()
    axes.set(xlim=(left, right), ylim=(low, high))
    scale, unit = prefixed("m", max(right - left, high - low), style.units)
    for name, axis in (("x", axes.xaxis), ("y", axes.yaxis)):
        axis.set_major_formatter(in_multiples(scale))
        axis.set_label_text(f"{name} [{unit}]")


def add_legend(axes: Axes, seen: Snapshot, field: Field, style: Style) -> None:
    """Add the colour bar, as high as the axes, and the key of the forces."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    if field.values is not None:
        scale, name = scale_of(field, style)
        colours = ScalarMappable(Normalize(*style.limits), style.colours)
        picture: Any = axes.get_figure()
        _make_room(axes)
        place = axes.inset_axes((1.03, 0.0, 0.035, 1.0))
        bar = picture.colorbar(colours, cax=place, label=name, extend=style.beyond)
        bar.ax.yaxis.set_major_formatter(in_multiples(scale))
    if style.largest_force:
        add_key(axes, seen, style)


def _make_room(axes: Axes) -> None:
    """Leave room for a colour bar in the place of axes in a grid, once, where no layout of the figure does."""
    figure: Any = axes.get_figure()
    place = axes.get_subplotspec()
    if place is None or figure.get_layout_engine() is not None:
        return
    if isinstance(place.get_gridspec(), matplotlib_module("gridspec").GridSpecFromSubplotSpec):
        return
    share = BAR / (place.get_position(figure).width * figure.bbox.width / figure.dpi)
    axes.set_subplotspec(place.subgridspec(1, 2, width_ratios=(1.0 - min(share, 0.5), min(share, 0.5)))[0])
