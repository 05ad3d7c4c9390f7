"""Faults planted into a small session that is tracked: whatever fails, nothing is lost and nothing false is said.

`python -m faults` (from tests/; `make faults`) prints a table of them. A new kind of fault is a function in `kinds.py`
or `process_kinds.py` and its line in that file's table; everything random in it comes from `trial.rng`, so that
`--seed N --only KIND` does it again.
"""
