"""What an error costs, parameter by parameter, on four scenes: the work-precision study, resumable.

    python -m examples.studies.work_precision --out out/work_precision   # run what is missing, write the page
    python -m examples.studies.work_precision page                 # the page from what has been run
    python -m examples.studies.work_precision promises             # `skmpm.suggest` on scenes not in the study

`python examples/studies/work_precision` does the same by path; every command knows --help.
"""

import sys
from pathlib import Path

if not __package__:  # run by path: the packages are looked for in the root of the repository
    sys.path[0] = str(Path(__file__).resolve().parents[3])

from examples.studies import sweeps
from examples.studies.work_precision import page, promises, study

if __name__ == "__main__":
    sweeps.named(study, page=page, promises=promises)
