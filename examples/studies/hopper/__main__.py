"""Clogging of a hopper by soft discs: width of the outlet, and softness.

    python -m examples.studies.hopper --out out/hopper    # run what is missing, write the page
    python -m examples.studies.hopper figures             # draw the figures, write the page

`python examples/studies/hopper` does the same by path; every command knows --help.
"""

import sys
from pathlib import Path

if not __package__:  # run by path: the packages are looked for in the root of the repository
    sys.path[0] = str(Path(__file__).resolve().parents[3])

from examples.studies import sweeps
from examples.studies.hopper import figures, study

if __name__ == "__main__":
    sweeps.command(study, figures=figures)
