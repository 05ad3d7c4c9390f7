"""Where should the cameras stand? A run's rig and others, for the motion at hand: what errors to expect of each.

`bound.py` predicts in seconds what a rig would tell, linearised; `results.uncertainty.twin` draws the run as the rig
would film it and tracks that, which takes minutes and is measured. `places.py` has cameras and grids of places and
chooses among these; `study.py` puts both together and keeps them with the run.
"""
