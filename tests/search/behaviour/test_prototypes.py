"""The prototype of each cluster is its likeliest frame among its own, wherever it was recorded."""

import numpy as np

from studio.search.behaviour.prototypes import find_prototypes


def test_prototypes_are_the_likeliest_of_the_clusters_own_frames() -> None:
    recordings = [np.arange(6.0).reshape(3, 2), 10.0 + np.arange(4.0).reshape(2, 2)]
    labels = [np.array([0, 2, 0]), np.array([1, 0])]
    # The likeliest frame of all, 3 for the last cluster, may be another cluster's.
    densities = -np.array(
        [[5.0, 1.0, 9.0], [1.0, 2.0, 8.0], [4.0, 0.0, 7.0], [0.0, 3.0, 0.0], [6.0, 9.0, 1.0]]
    )
    found = find_prototypes(recordings, labels, densities, np.array([[0.1], [0.2], [0.3]]))
    np.testing.assert_array_equal(found.poses, [[4.0, 5.0], [10.0, 11.0], [2.0, 3.0]])
    np.testing.assert_array_equal(found.recordings, [0, 1, 0])
    np.testing.assert_array_equal(found.frames, [2, 0, 1])
    np.testing.assert_array_equal(found.derivatives, [[0.1], [0.2], [0.3]])
