"""Compaction of mixtures of rigid and soft discs: solid fraction against pressure, share of rigid discs, friction.

    python -m examples.studies.mixtures --out out/mixtures    # run what is missing, write the page
    python -m examples.studies.mixtures figures               # draw the figure, write the page

`python examples/studies/mixtures` does the same by path; every command knows --help.
"""

import sys
from pathlib import Path

if not __package__:  # run by path: the packages are looked for in the root of the repository
    sys.path[0] = str(Path(__file__).resolve().parents[3])

from examples.studies import sweeps
from examples.studies.mixtures import figures, study

if __name__ == "__main__":
    sweeps.command(study, figures=figures)
