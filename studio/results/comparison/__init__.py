"""Trackers compared fairly on a session with truth: plan, trials, findings, and their files.

A sweep is a comparison whose candidates are the points of a grid (`Plan.vary`, `sweep.py`). Its trials are runs of
the session that are tracked to their end and measured (`operations/jobs/swept_runs.py`); everything else is the
comparison's. How long something takes is estimated by stored runs (`stored_pace` in `runs/pace.py`).
"""
