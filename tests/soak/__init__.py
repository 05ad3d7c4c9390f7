"""A studio under load for long: `python -m soak` (from tests/; `make soak`) prints its figures, and whether they hold.

Time is scaled: footage of eight hours has every `--scale`-th of its frames, stored as a tracker would store them;
scrubbing, lists and viewers are whole.
"""
