"""Examples: short scripts, one topic each; `studies` holds the long-running ones."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).parent))  # so that the scripts import `drawing` also as modules of this package
