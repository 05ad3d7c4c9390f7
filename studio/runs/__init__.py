"""One run: a session and settings through the frame loop into a results store.

`TrackingRun.step_layer` (`tracking_run.py`) does a layer, which batches and the tracking process repeat;
`problem_source.py` makes pictures, masks and maps of each frame ready, `frame_loop.FrameSearch` searches it,
`FrameRefiner` puts the pose onto the silhouettes and draws limbs again that they deny, `RunWatch` says how the frame
stands. When a run is made, the body's shape is fitted to what its first thirty frames show
(`setup/shape_on_the_way.py`); after its last frame exchanged sides are corrected in a track beside what was tracked
(`sides.py`). Where a kernel has to be compiled, another process
compiles what follows the first layer (`compiling_beside.py`).

What a slider moved and no frame used yet lies in the run's `moved_knobs.json` (`moved_knobs.py`). What is tried of a
frame and kept is a run of its own (`branching.py`): frames before it are copied, it is tracked again from the same
start with the same random numbers. Several bodies at once share masks by limbs and their colours (`together.py`,
`setup/pixel_owners.py`).
"""
