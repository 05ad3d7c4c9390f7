"""Motion files out of a run, each read back after writing."""
