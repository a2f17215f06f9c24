"""Materials: energy, stress and tangent at the points, all per volume of the anchor configuration.

A body grid is anchored: the solver moves points by a deformation gradient `F` relative to the anchor, where the
points already had `F_anchor` and Cauchy stress `stress_anchor` (both None for an undeformed, unstressed anchor).
Every material answers in that frame, so that stresses and tangents meet the gradients of the anchored body grid
directly.

Against locking a material may be told the `dilatation` of the points, their volume over their undeformed volume, as
an average over neighbours: it then takes the place of the points' own wherever lambda multiplies it (mean dilatation;
Nagtegaal, Parks & Rice, CMAME 4, 1974; Simo, Taylor & Pister, CMAME 51, 1985).
"""

from skmpm.material.elastic import Elastic, Isotropic, determinant, poisson_ratio, product
from skmpm.material.hessian import hessian, projected_hessian
from skmpm.material.linear import LinearElastic
from skmpm.material.neohookean import NeoHookean
from skmpm.material.rigid import Rigid

Material = LinearElastic | NeoHookean | Rigid

__all__ = [
    "Elastic",
    "Isotropic",
    "LinearElastic",
    "Material",
    "NeoHookean",
    "Rigid",
    "determinant",
    "hessian",
    "poisson_ratio",
    "product",
    "projected_hessian",
]
