"""What each feature costs when it is on, and what is not done when it is off.

    python -m examples.studies.feature_cost --docs docs

`python examples/studies/feature_cost` does the same by path; --help lists the options.
"""

import sys
from pathlib import Path

if not __package__:  # run by path: the packages are looked for in the root of the repository
    sys.path[0] = str(Path(__file__).resolve().parents[3])

from examples.studies.feature_cost import study

if __name__ == "__main__":
    study.main(study.parser().parse_args())
