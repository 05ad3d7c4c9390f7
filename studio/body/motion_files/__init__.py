"""Files of recorded motion, read and written: BVH, ASF/AMC, C3D, TRC, and arrays of the AMP humanoid.

What other programs mean: vertical, zeros and counting of markers in `marker_meaning.py` and `truth_files.py`, tables
of points in `points_tables.py`, arrays in `points_arrays.py`.
"""
