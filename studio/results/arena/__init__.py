"""Frames as black-box problems for anybody's optimiser, racers on them, and profiles of how fast each comes how near.

`Problem` is a frame's likelihood over bounds, with the prior that the frame before left and the heaviest pose that a
long reference search knows of it. `making` makes one of a stored run's frame, `problem_files` lets a set travel without
its footage, `racers` are the searches, `racing` runs one of them on a problem, `profiles` sums trials up, `reports`
makes them charts and tables.
"""
