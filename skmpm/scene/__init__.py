"""The scene (`Scene`), its state (`State`), and the checks of both."""

from skmpm.scene.check import MAX_OVERLAP, TOUCHING, check_walls_at_start, overlaps
from skmpm.scene.fits import check_fits, check_initial_positions, check_scene
from skmpm.scene.functions import DISPLACEMENT, LOAD, VELOCITY, functions_of_time, varies_in_time
from skmpm.scene.layout import material_at
from skmpm.scene.model import initial_internal, plastic_strain
from skmpm.scene.objects import Body, Load, Pressure, Spring, Support, Wall, rigid_motion
from skmpm.scene.out_of_plane import mises, stress_zz
from skmpm.scene.periodic import Periodic, box_corners, deformed, into_box, recut
from skmpm.scene.point_sets import Ends, stiffness_of, support_angle, support_arms, support_rotations
from skmpm.scene.prescribed import (
    PrescribedVelocities,
    centres,
    fitted_motions,
    gravity_at,
    initial_rigid_motion,
    mean_velocity,
    normal_speeds,
    prescribed_velocities,
    velocity_at,
    with_normal_speeds,
)
from skmpm.scene.report import Energy, Report, StepControl
from skmpm.scene.scene import Scene
from skmpm.scene.stages import at_rest, continued
from skmpm.scene.state import Contacts, Derived, Factored, State, StepFailed, between_bodies, pair_numbers
from skmpm.scene.walls_in_view import view_of, wall_lines
from skmpm.values import SceneError, field_values, motion

__all__ = [
    "DISPLACEMENT",
    "LOAD",
    "MAX_OVERLAP",
    "TOUCHING",
    "VELOCITY",
    "Body",
    "Contacts",
    "Derived",
    "Ends",
    "Energy",
    "Factored",
    "Load",
    "Periodic",
    "PrescribedVelocities",
    "Pressure",
    "Report",
    "Scene",
    "SceneError",
    "Spring",
    "State",
    "StepControl",
    "StepFailed",
    "Support",
    "Wall",
    "at_rest",
    "between_bodies",
    "box_corners",
    "centres",
    "check_fits",
    "check_initial_positions",
    "check_scene",
    "check_walls_at_start",
    "continued",
    "deformed",
    "field_values",
    "fitted_motions",
    "functions_of_time",
    "gravity_at",
    "initial_internal",
    "initial_rigid_motion",
    "into_box",
    "material_at",
    "mean_velocity",
    "mises",
    "motion",
    "normal_speeds",
    "overlaps",
    "pair_numbers",
    "plastic_strain",
    "prescribed_velocities",
    "recut",
    "rigid_motion",
    "stiffness_of",
    "stress_zz",
    "support_angle",
    "support_arms",
    "support_rotations",
    "varies_in_time",
    "velocity_at",
    "view_of",
    "wall_lines",
    "with_normal_speeds",
]
