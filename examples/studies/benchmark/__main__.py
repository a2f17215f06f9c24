"""What a step costs: by phases, beside one sparse LU of the same matrix, and as scenes grow; resumable.

    python -m examples.studies.benchmark --out out/benchmark      # measure what is missing, write its page
    python -m examples.studies.benchmark crossover                # banded Cholesky against multigrid
    python -m examples.studies.benchmark large --points 1000000   # one body by multigrid, in detail

`python examples/studies/benchmark` does the same by path; every command knows --help.
"""

import sys
from pathlib import Path

if not __package__:  # run by path: the packages are looked for in the root of the repository
    sys.path[0] = str(Path(__file__).resolve().parents[3])

from examples.studies import sweeps
from examples.studies.benchmark import crossover, large, study

if __name__ == "__main__":
    sweeps.named(study, crossover=crossover, large=large)
