"""A real pose of each cluster, for starts of searches and for pictures of the cluster (Fig. 2)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.foundations.arrays import Array

IntArray = NDArray[np.int64]


@dataclass(frozen=True, slots=True, eq=False)
class Prototypes:
    """One training frame a cluster, the one its Gaussian finds most likely.

    poses : (K, D) as recorded, global position and orientation included. derivatives : (K, d) the clusters' mean ẋ,
    rad (mm) per frame at the model's rate. recordings, frames : (K,) which recording, and its frame.
    """

    poses: Array
    derivatives: Array
    recordings: IntArray
    frames: IntArray


def find_prototypes(
    recordings: Sequence[Array], labels: Sequence[IntArray], log_densities: Array, derivatives: Array
) -> Prototypes:
    """The prototypes of clusters that all have frames of their own.

    recordings : poses (F, D) each. labels : their clusters (F,). log_densities : (n, K) of all frames one after the
    other. derivatives : (K, d) mean ẋ.
    """
    owner = np.concatenate(labels)
    places = np.empty(log_densities.shape[1], dtype=np.int64)
    for cluster in range(log_densities.shape[1]):
        own = np.flatnonzero(owner == cluster)
        places[cluster] = own[np.argmax(log_densities[own, cluster])]
    begins = np.concatenate([[0], np.cumsum([len(poses) for poses in recordings])[:-1]])
    which = np.searchsorted(begins, places, side="right") - 1
    return Prototypes(
        poses=np.concatenate(recordings)[places],
        derivatives=derivatives,
        recordings=which.astype(np.int64),
        frames=places - begins[which],
    )
