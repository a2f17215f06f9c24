"""Bodies between two arcs: voussoirs of arches, rings that are open on one side."""

import numpy as np

from skmpm import Points, box


def sector(inner, outer, begin, end, *, spacing):
    """Points of the part of a ring between two angles [rad]: those of a box, wrapped round the origin."""
    middle = 0.5 * (inner + outer)
    flat = box((inner, middle * begin), (outer - inner, middle * (end - begin)), spacing=spacing)
    r, angle = flat.x[0], flat.x[1] / middle
    return Points(r * np.array([np.cos(angle), np.sin(angle)]), flat.volume * r / middle, flat.outline)
