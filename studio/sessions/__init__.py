"""What lies on disk: sessions, their footage and calibration, runs and their results.

**A session is foreign until proven.** All its bytes are read through `foundations/foreign_files.py` (regular files,
inside the session, of bounded size; footage alone may lie elsewhere), its databases opened through
`session_databases.py` (ordinary tables, queries that end); `tests/house/test_session_reading.py` holds it.
`foreign_sessions.py` says what is odd about a folder or archive, `tests/hostile` has a maker for each kind of attack.

**Records have versions.** Every stored record is a `RecordFile` (`record_files.py`): a type, a version, what makes a
file of each older version one of the next, and what it cannot be. Stores and canonical calibrations have versions
too; `tests/old_sessions` holds folders that older versions wrote.

**Damage is detected.** Each frame's checksums lie beside it (`results_codec.py`), files have theirs in
`.checksums.json`. `ResultsReader` leaves damaged frames out and names them, `TrackingRun` tracks them first. A reader
reads only the frames after its last one while a run goes on: `ResultsWriter` counts whenever it stores anything but a
new last frame, and readers that see another count read all again.

**Nothing is moved under work.** `work_under_way.py` knows what other processes work on; verbs are declared
`keeping_in_place`, jobs say it through `JobRunner.during`, and `Workspace` moves nothing that is worked on. Who
changes a record that was read before does it in `one_at_a_time`. `tests/races` fires verbs at the same time and kills
some.

**A session by address** (`s3://…`, `remote_sessions.py` over `object_stores.py`) is worked on through a copy in a
cache; `put_run` and `comparison_put_back` put back what was made, the record that says *whole* last. No other room
knows stores.
"""
