"""One small change at a time in a science room's code, to see whether that room's own tests notice it.

`python -m mutants` (from tests/; `make mutants`) prints a table: of each room how many of the drawn changes its tests
killed, and which survived. Which changes are drawn depends on the seed alone; what became of them is kept under
build/mutants, so that a run that was stopped goes on, and `--again` tries only what survived. What no test can notice
stands in `equivalent.toml`, with the reason.

Our own, since mutmut calls a function's forms through a wrapper that Numba cannot compile, and cosmic-ray changes the
checkout in place. Compiled kernels need no care: their cache goes by what they are made of.
"""
