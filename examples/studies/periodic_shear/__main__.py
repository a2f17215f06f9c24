"""Simple shear of periodic packings at constant pressure: friction and volume change.

    python -m examples.studies.periodic_shear --out out/shear    # run what is missing, write the page
    python -m examples.studies.periodic_shear figures            # draw the figure, write the page

`python examples/studies/periodic_shear` does the same by path; every command knows --help.
"""

import sys
from pathlib import Path

if not __package__:  # run by path: the packages are looked for in the root of the repository
    sys.path[0] = str(Path(__file__).resolve().parents[3])

from examples.studies import sweeps
from examples.studies.periodic_shear import figures, study

if __name__ == "__main__":
    sweeps.command(study, figures=figures)
