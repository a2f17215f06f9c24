"""Pictures and films of scenes (matplotlib, the extra `plot`).

matplotlib is imported when something is drawn, not with the library.
"""

from skmpm.plot.figure import plot
from skmpm.plot.film import animate

__all__ = ["animate", "plot"]
