"""Blobs fitted to a hull's voxels by K-means (Caillette, Galata & Howard 2007, section 6.3).

From the mixture of a predicted pose, voxels are given to the nearest blob (Mahalanobis distance on position and colour,
E-step) and every blob then takes the mean, covariance and colour of what it was given (M-step). This is done from
several predicted poses; the mixture under which the voxels are likeliest is kept. It is a hard clustering, so the
likelihood is that of each voxel from its own blob, ln β_j + ln N(x; μ_j, Σ_j), the mean over the hull's volume.

Where the paper leaves things open or pure K-means breaks down:

- A fit ends when almost no voxel changes its blob, or when the likelihood falls: nearest by Mahalanobis distance is not
  likeliest, and without this rule the largest blobs keep growing.
- Every predicted pose is also tried translated so that its mean is the hull's: this mostly finds a body that moved
  faster than expected, where K-means alone would assign one leg's voxels to the other.

- A blob with few voxels (a hand inside the trunk's hull) stays near its prediction: the M-step counts the predicted
  blob as PRIOR_SHARE of its usual volume. A blob without voxels stays where it was predicted.
- Larger voxels of the octree count by their volume and add their own extent, edge² / 12, to the covariance.
- The likelihood by which starts are compared and a loss is detected uses the learnt colours. With the colours fitted to
  the blobs, a mixture fitted to any object of even colour would look likely.
- Before colours are learnt every blob has the hull's own mean colour, and colour has no effect.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.evidence.volume.blob_kernels import FACTORS, LOG_TWO_PI, assign, fill_factors, fit
from studio.evidence.volume.blob_model import SMALLEST_VARIANCE, BlobMixture, BlobModel
from studio.evidence.volume.hull import Hull
from studio.foundations.arrays import Array, Floats

Labels = NDArray[np.int32]

PRIOR_SHARE = 0.05
LEAST_COLOUR_VARIANCE = 36.0
"""levels²: least colour variance of a blob (6 levels), for changes of light and camera."""
STILL = 0.002
"""Share of voxels that may still change their blob when the fit stops."""
NEAR_ENOUGH = 20.0
"""mm: a prediction whose mean is this near the hull's is not tried translated."""


@dataclass(frozen=True, slots=True, eq=False)
class Voxels:
    """A hull ready for fitting. rows : (6, K) float32, positions from `centre` (3,) mm and colours. shares : (K,) of
    the volume. extents : (K,) edge² / 12, mm². colour, colour_variance : (3,) of the whole hull.
    """

    rows: Floats
    shares: Array
    extents: Array
    centre: Array
    colour: Array
    colour_variance: Array

    @classmethod
    def of(cls, hull: Hull) -> "Voxels":
        """The voxels of a hull that is not empty; those without colour get the hull's mean colour."""
        shares = np.asarray(hull.weights(), dtype=np.float64)
        centre = shares @ hull.centres
        colours = np.asarray(hull.colours, dtype=np.float64)
        known = np.asarray(np.isfinite(colours).all(axis=1))
        own = shares[known] / shares[known].sum() if known.any() else np.zeros(0)
        mean = own @ colours[known] if known.any() else np.full(3, 128.0)
        variance = own @ (colours[known] - mean) ** 2 if known.any() else np.zeros(3)
        colours = np.where(known[:, None], colours, mean)
        rows = np.ascontiguousarray(np.column_stack([hull.centres - centre, colours]).T, dtype=np.float32)
        extents = np.asarray(hull.edges, dtype=np.float64) ** 2 / 12.0
        return cls(rows, shares, extents, centre, mean, np.maximum(variance, LEAST_COLOUR_VARIANCE))

    def no_labels(self) -> Labels:
        return np.empty(int(self.rows.shape[1]), dtype=np.int32)


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """The best fit. mixture : blob b is the model's blob b. labels : (K,) each voxel's nearest. log_likelihood : nats a
    voxel, of the best fit; log_likelihoods : of every fit: S from the poses, then those tried
    from the poses translated to the hull. start : the pose (0...S - 1) of the best. margin : the likelihood
    less that of a body exactly like the model, nats a voxel.
    """

    mixture: BlobMixture
    labels: Labels
    log_likelihood: float
    log_likelihoods: Array
    start: int
    margin: float


def fit_blobs(
    hull: Hull, model: BlobModel, body: BodyModel, starts: Array, iterations: int = 8, *, moved: bool = True
) -> Fitted:
    """The model's blobs fitted to a hull that is not empty, from poses (S, D); iterations : at most, of each fit.
    moved : also from each pose moved so that its mean is the hull's, where that is further than NEAR_ENOUGH.

    Raises BodyError for poses that are not the body's, ValueError for an empty hull.
    """
    if len(hull.centres) == 0:
        raise ValueError("Blobs cannot be fitted to an empty hull.")
    voxels = Voxels.of(hull)
    coloured = model.in_colour(voxels.colour, voxels.colour_variance)
    predicted = coloured.mixture(body, starts)
    begun = [_state_of(predicted.at(start), voxels.centre) for start in range(len(predicted.means))]
    origins = list(range(len(begun)))
    if moved:
        for start, state in enumerate(begun[:]):
            shift = state[:, 15] @ state[:, :3]
            if np.linalg.norm(shift) > NEAR_ENOUGH:
                begun.append(np.column_stack([state[:, :3] - shift, state[:, 3:]]))
                origins.append(start)
    colours = np.column_stack([coloured.colour, coloured.colour_variance])
    rules = np.array([iterations, STILL, PRIOR_SHARE, LEAST_COLOUR_VARIANCE, SMALLEST_VARIANCE])
    fitted, labels = [np.empty_like(state) for state in begun], [voxels.no_labels() for _ in begun]
    likelihoods = np.array(
        [
            fit(voxels.rows, voxels.shares, voxels.extents, state, colours, rules, best, own)
            for state, best, own in zip(begun, fitted, labels, strict=True)
        ]
    )
    best = int(np.argmax(likelihoods))
    likelihood = float(likelihoods[best])
    margin = likelihood - self_likelihood(coloured)
    mixture = _mixture_of(fitted[best], voxels.centre)
    return Fitted(mixture, labels[best], likelihood, likelihoods, origins[best], margin)


def nearest_blobs(voxels: Voxels, mixture: BlobMixture) -> Labels:
    """(K,) the blob of a mixture, means (B, 3), that each voxel is nearest to; all colours known."""
    labels, distances = voxels.no_labels(), np.empty(voxels.rows.shape[1], dtype=np.float32)
    factors = np.empty((len(mixture.means), FACTORS), dtype=np.float32)
    fill_factors(_state_of(mixture, voxels.centre), factors)
    assign(voxels.rows, factors, labels, distances)
    return labels


def self_likelihood(model: BlobModel) -> float:
    """Expected likelihood of a body exactly like the model, nats a voxel, each voxel from its own blob:
    Σ α (ln α - ½ ln ((2πe)^6 |Σ| |C|)); all colours known.
    """
    logs = np.log(model.eigenvalues).sum(axis=1) + np.log(model.colour_variance).sum(axis=1)
    return float(model.weight @ (np.log(model.weight) - 0.5 * (6.0 * (LOG_TWO_PI + 1.0) + logs)))


def _state_of(mixture: BlobMixture, centre: Array) -> Array:
    """A mixture of means (B, 3) in the kernels' layout (B, STATE), about `centre` (3,)."""
    upper = mixture.covariances[:, [0, 0, 0, 1, 1, 2], [0, 1, 2, 1, 2, 2]]
    return np.column_stack(
        [mixture.means - centre, upper, mixture.colours, mixture.colour_variances, mixture.weights]
    )


def _mixture_of(state: Array, centre: Array) -> BlobMixture:
    """The inverse of `_state_of`."""
    covariances = state[:, [3, 4, 5, 4, 6, 7, 5, 7, 8]].reshape(-1, 3, 3)
    return BlobMixture(state[:, :3] + centre, covariances, state[:, 9:12], state[:, 12:15], state[:, 15])
