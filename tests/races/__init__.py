"""Verbs that are fired at the same time on one session, by a server and by other processes, some of which are killed.

`python -m races` (from tests/; `make races`) prints what became of them. A new verb is a line of the table in
`verbs.py`; everything random of a group comes from its seed, so that `--seed N --groups 1` fires the same again.
"""
