"""Examples: short scripts, one topic each, which stand alone; `studies` holds the long-running ones."""
