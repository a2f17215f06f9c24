"""Examples: short lessons, each a script of its own; `studies` holds the long ones."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent))  # lessons find `drawing` also when imported as modules of this package
