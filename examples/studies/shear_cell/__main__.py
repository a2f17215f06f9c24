"""Plane shear between rough walls at constant pressure: friction against the inertial number and softness.

    python -m examples.studies.shear_cell --out out/shear_cell    # run what is missing, write the page
    python -m examples.studies.shear_cell figures                 # draw the figures, write the page

`python examples/studies/shear_cell` does the same by path; every command knows --help.
"""

import sys
from pathlib import Path

if not __package__:  # run by path: the packages are looked for in the root of the repository
    sys.path[0] = str(Path(__file__).resolve().parents[3])

from examples.studies import sweeps
from examples.studies.shear_cell import figures, study

if __name__ == "__main__":
    sweeps.command(study, figures=figures)
