"""The inside of a stored run: the views that show how its search went, and why a frame failed.

`views.py` lists them: each is a module with its tables (`VIEW`) and the function that makes their rows of a stored
frame or run. A layer's record keeps both parents of every particle of the next. A frame that was annealed again is a
trial, which `InspectedRun(…, tried)` puts in the place of its frame, so that every view has its numbers.
`likelihoods.py` evaluates a stored frame again, `retracking.py` tracks a stretch again without writing,
`over_frames.py` keeps what is read of every frame. Whether a frame fits and which limbs are lost is decided in
`verdict.py` alone; `why.py` names the cause of a failure by rules that its docstring lists. A view that is not waited
for any more stops between two steps (`wanted.py`). `shared_page.py` puts a run into one file: the same tables and
drawings.
"""
