"""Runs of running cameras, and their replay.

Frames come on a clock: `LiveSource → Arrival → LiveProblems.ready` in the pipeline's thread, `LiveRun.take →
step_layer` in the tracking process's own, results stored by a third; the newest that is ready wins, the rest is
counted. A thread a camera (`LiveCamera`) → `SetRecording` pairs the newest pictures and writes them into a session
(`sessions/live_recordings.py`) → `SetFollower` reads its lines. What is tracked is what lies on disk; a camera
without a picture is no view of that frame.
"""
