"""The command line of the study: what `study.py` says, or `figures`, by module or by path."""

import sys
from pathlib import Path

if not __package__:  # run by path: the packages are looked for in the root of the repository
    sys.path[0] = str(Path(__file__).resolve().parents[3])

from examples.studies import sweeps
from examples.studies.hopper import study

if __name__ == "__main__":
    sweeps.command(study)
