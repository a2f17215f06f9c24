"""skmpm: implicit material point method on scikit-fem with Contact Dynamics, for packings of soft bodies.

Build a `Scene` of `Body`s and `Wall`s, read its `report`, then loop over `simulate(scene, dt=..., until=...)`;
`observe` measures the states it yields, `record` writes them for ParaView.
"""

from skmpm import contact, coulomb, linear, outline, transfer
from skmpm.io import CheckpointError, load, record, save
from skmpm.material import LinearElastic, NeoHookean, Rigid
from skmpm.observe import Observables, observe
from skmpm.packing import Packing, PackingError, packing
from skmpm.points import Points, box, disc, from_mesh
from skmpm.scene import Body, Load, Scene, SceneError, State, StepFailed, Support, Wall
from skmpm.scheme import Scheme
from skmpm.simulate import Suggestion, initial, report, simulate, step, suggest

__version__ = "0.1.0"

__all__ = [
    "Body",
    "CheckpointError",
    "LinearElastic",
    "Load",
    "NeoHookean",
    "Observables",
    "Packing",
    "PackingError",
    "Points",
    "Rigid",
    "Scene",
    "SceneError",
    "Scheme",
    "State",
    "StepFailed",
    "Suggestion",
    "Support",
    "Wall",
    "box",
    "contact",
    "coulomb",
    "disc",
    "from_mesh",
    "initial",
    "linear",
    "load",
    "observe",
    "outline",
    "packing",
    "record",
    "report",
    "save",
    "simulate",
    "step",
    "suggest",
    "transfer",
]
