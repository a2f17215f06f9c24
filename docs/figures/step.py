"""How a step goes through the modules: the figure of docs/theory/steps.md."""

from drawing import arrow, canvas, save
from matplotlib.patches import FancyBboxPatch

WIDTH, HEIGHT = 3.9, 0.62  # of a box
VIEW = ((-3.75, 3.3), (-9.4, 0.4))
STEPS = (  # what is done, and the module that does it
    ("choose the length of the step", "stepping.step_length"),
    ("build body grids, if they are to be new", "step.regrid"),
    ("prescribed velocities, loads, unknowns", "step.start"),
    ("find contacts, linearise their gaps", "contact"),
    ("forces that do not balance, matrix", "step.equations"),
    ("contact impulses: Signorini, Coulomb", "coulomb"),
    ("line search along the new velocities", "step.line_search"),
    ("from nodes to material points", "step.new_state"),
    ("accept or reject the result", "step.acceptance"),
    ("State", "scene.state"),
)


def draw(ink):
    """Boxes below each other, and the loops beside them."""
    axes = canvas(4.9, VIEW)
    for k, (text, module) in enumerate(STEPS):
        newton, last = 3 <= k <= 6, k == len(STEPS) - 1
        face = ink.body if newton else ink.other if k in (0, 8) else "none"
        style = {"boxstyle": "round,pad=0.0,rounding_size=0.12", "facecolor": face, "edgecolor": ink.muted}
        axes.add_patch(FancyBboxPatch((-0.5 * WIDTH, -k - 0.5 * HEIGHT), WIDTH, HEIGHT, **style))
        axes.text(0.0, -k + 0.11, text, color=ink.text, ha="center", va="center", size=8.5)
        axes.text(0.0, -k - 0.16, module, color=ink.muted, ha="center", va="center", size=6.8, family="monospace")
        if not last:
            arrow(axes, (0.0, -k - 0.5 * HEIGHT), (0.0, -k - 1.0 + 0.5 * HEIGHT), ink.muted, 1.0)
    loop(axes, ink, 5.93, 3.07, -0.3, "until forces balance\n(Newton)")
    loop(axes, ink, 6.12, 2.88, -1.1, "without inertia:\nuntil in equilibrium")
    loop(axes, ink, 8, 0, 0.5, "rejected, or not converged:\na shorter step")
    return axes.figure


def loop(axes, ink, begin, end, beyond, text):
    """An arrow from a box to one above it, on the left where it goes beyond the boxes by a negative distance."""
    side = 0.5 * WIDTH if beyond > 0.0 else -0.5 * WIDTH
    x = side + beyond
    axes.plot((side, x, x), (-begin, -begin, -end), color=ink.force, linewidth=1.3, solid_capstyle="round")
    arrow(axes, (x, -end), (side, -end), ink.force, 1.3)
    at = x + (0.34 if beyond > 0.0 else -0.34)
    axes.text(at, -0.5 * (begin + end), text, color=ink.text, size=7.5, rotation=90.0, ha="center", va="center")


if __name__ == "__main__":
    save("step", draw)
