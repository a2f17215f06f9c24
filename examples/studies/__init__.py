"""Studies: packages that run for minutes to hours, resume, and write pages of the docs from their data."""

import os

os.environ.setdefault("MPLBACKEND", "Agg")  # no study opens windows
