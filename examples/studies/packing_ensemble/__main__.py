"""How soft discs fill space with and without friction: an ensemble of packings, resumable.

    python -m examples.studies.packing_ensemble --out out/study        # run what is missing, write the page
    python -m examples.studies.packing_ensemble figures                # the page from what has been run
    python -m examples.studies.packing_ensemble archive                # what has finished, for another machine
    python -m examples.studies.packing_ensemble main_job --discs 300   # one packing, with checks at every step
    python -m examples.studies.packing_ensemble choices steps          # what the step of the main job costs
    python -m examples.studies.packing_ensemble choices resolution     # and its cells and points
    python -m examples.studies.packing_ensemble own_jamming            # from which point coordination grows

`python examples/studies/packing_ensemble` does the same by path; every command knows --help.
"""

import sys
from pathlib import Path

if not __package__:  # run by path: the packages are looked for in the root of the repository
    sys.path[0] = str(Path(__file__).resolve().parents[3])

from examples.studies import sweeps
from examples.studies.packing_ensemble import archive, choices, figures, main_job, own_jamming, study

if __name__ == "__main__":
    sweeps.named(study, archive=archive, choices=choices, figures=figures, main_job=main_job, own_jamming=own_jamming)
