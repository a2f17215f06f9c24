"""Bodies whose motion is prescribed."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Rigid:
    """A body whose motion is prescribed (`Body.velocity`): it has no unknowns, others bump into it.

    Parameters
    ----------
    density : density [kg/m3]; it only weighs the contact normals of the shared-node law
    """

    density: float
