"""Steel discs in a box under a lid at 10 m/s, as in an example of LMGC90.

    python -m examples.studies.lmgc90_box --out out/lmgc90_box    # run what is missing, write the page

`python examples/studies/lmgc90_box` does the same by path.
"""

import sys
from pathlib import Path

if not __package__:  # run by path: the packages are looked for in the root of the repository
    sys.path[0] = str(Path(__file__).resolve().parents[3])

from examples.studies.lmgc90_box import study

if __name__ == "__main__":
    study.main(study.parser().parse_args())
