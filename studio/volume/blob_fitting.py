"""Blobs fitted to a hull's voxels by K-means (Caillette, Galata & Howard 2007, section 6.3).

From the mixture of a predicted pose, voxels are given to the nearest blob (Mahalanobis distance on position and colour,
E-step) and every blob then takes the mean, covariance and colour of what it was given (M-step). This is done from
several predicted poses; the mixture under which the voxels are likeliest is kept. It is a hard clustering, so the
likelihood is that of each voxel from its own blob, ln β_j + ln N(x; μ_j, Σ_j), the mean over the hull's volume.

Where the paper leaves things open or pure K-means breaks down:

- A fit ends when next to no voxel changes hands, or when the likelihood falls: nearest by Mahalanobis distance is not
  likeliest, and left alone a fit goes on to give the largest blobs ever more.
- Every predicted pose is also tried moved as a whole, so that its mean is the hull's: a body that came faster than
  expected is then mostly found at once, where K-means alone would give one leg's voxels to the other.

- A blob that is given little (a hand inside the trunk's hull) keeps to its prediction: the M-step counts the predicted
  blob as PRIOR_SHARE of its usual volume. A blob given nothing stays where it was predicted.
- Larger voxels of the octree count by their volume and add their own extent, edge² / 12, to the covariance.
- The likelihood that starts are compared by, and by which a loss is seen, uses the learnt colours. With the colours
  that the blobs take on in the fit, a mixture snapped to anything of even colour would look likely.
- Before colours are learnt every blob has the hull's own mean colour, and colour decides nothing.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studio.body.model import BodyModel
from studio.volume.blob_kernels import FACTORS, SUMS, assign, count_changes, gather
from studio.volume.blob_model import SMALLEST_VARIANCE, BlobMixture, BlobModel
from studio.volume.hull import Hull

Array = NDArray[np.float64]
Floats = NDArray[np.float32]
Labels = NDArray[np.int32]

PRIOR_SHARE = 0.05
LEAST_COLOUR_VARIANCE = 36.0
"""levels²: no blob is surer of its colour than 6 levels; light and camera are not."""
STILL = 0.002
"""Share of voxels that may still change hands when the fit stops."""
LOG_TWO_PI = math.log(2.0 * math.pi)


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
        """The voxels of a hull that is not empty; one whose colour no view gave has the hull's mean colour."""
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


@dataclass(frozen=True, slots=True, eq=False)
class Fitted:
    """The best fit. mixture : blob b is the model's blob b. labels : (K,) each voxel's nearest. log_likelihood : nats a
    voxel, of the best fit; log_likelihoods : of every fit, the S from the poses as they are, then the S from the poses
    moved to the hull. start : the pose (0...S - 1) of the best. margin : nats a voxel
    that the likelihood lies above (positive) or below (negative) what the model gives of a body just like itself.
    """

    mixture: BlobMixture
    labels: Labels
    log_likelihood: float
    log_likelihoods: Array
    start: int
    margin: float


def fit_blobs(
    hull: Hull,
    model: BlobModel,
    body: BodyModel,
    starts: Array,
    iterations: int = 8,
    *,
    moved: bool = True,
) -> Fitted:
    """The model's blobs fitted to a hull that is not empty, from poses (S, D); iterations : at most, of each fit.
    moved : also from each pose moved so that its mean is the hull's.

    Raises BodyError for poses that are not the body's, ValueError for an empty hull.
    """
    if len(hull.centres) == 0:
        raise ValueError("An empty hull has nothing to fit blobs to.")
    voxels = Voxels.of(hull)
    coloured = model.in_colour(voxels.colour, voxels.colour_variance)
    predicted = coloured.mixture(body, starts)
    begun = [_Blobs.of(predicted.at(start), voxels.centre) for start in range(len(predicted.means))]
    if moved:
        begun += [blobs.centred() for blobs in begun]
    fits = [_fit_one(voxels, coloured, blobs, iterations) for blobs in begun]
    likelihoods = np.array([fit[2] for fit in fits])
    best = int(np.argmax(likelihoods))
    blobs, labels, _ = fits[best]
    mixture = BlobMixture(
        blobs.means + voxels.centre, blobs.covariances, blobs.colours, blobs.variances, blobs.weights
    )
    found = float(likelihoods[best])
    start = best % len(predicted.means)
    return Fitted(mixture, labels, found, likelihoods, start, found - self_likelihood(coloured))


def nearest_blobs(voxels: Voxels, mixture: BlobMixture) -> Labels:
    """(K,) the blob of a mixture, means (B, 3), that each voxel is nearest to; all colours known."""
    blobs = _Blobs.of(mixture, voxels.centre)
    labels, distances = _room(voxels)
    assign(voxels.rows, blobs.factors(), labels, distances)
    return labels


def self_likelihood(model: BlobModel) -> float:
    """Nats a voxel of a body that is just as the model says, each voxel from its own blob:
    Σ α (ln α - ½ ln ((2πe)^6 |Σ| |C|)); all colours known.
    """
    logs = np.log(model.eigenvalues).sum(axis=1) + np.log(model.colour_variance).sum(axis=1)
    return float(model.weight @ (np.log(model.weight) - 0.5 * (6.0 * (LOG_TWO_PI + 1.0) + logs)))


@dataclass(frozen=True, slots=True, eq=False)
class _Blobs:
    """A mixture in the voxels' coordinates: means (B, 3), covariances (B, 3, 3), colours, variances (B, 3)."""

    means: Array
    covariances: Array
    colours: Array
    variances: Array
    weights: Array

    @classmethod
    def of(cls, mixture: BlobMixture, centre: Array) -> "_Blobs":
        return cls(
            mixture.means - centre,
            mixture.covariances,
            mixture.colours,
            mixture.colour_variances,
            mixture.weights,
        )

    def centred(self) -> "_Blobs":
        """Moved so that the mixture's mean is the voxels'."""
        means = self.means - self.weights @ self.means
        return _Blobs(means, self.covariances, self.colours, self.variances, self.weights)

    def factors(self) -> Floats:
        """(B, FACTORS) as the kernel reads them: the root of Σ⁻¹ is the upper triangle Lᵀ of Σ⁻¹ = L Lᵀ."""
        root = np.linalg.cholesky(np.linalg.inv(self.covariances))
        table = np.empty((len(self.means), FACTORS), dtype=np.float32)
        table[:, 0:3] = self.means
        for column, (i, j) in enumerate(((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))):
            table[:, 3 + column] = root[:, j, i]
        table[:, 9:12] = self.colours
        table[:, 12:15] = 1.0 / np.sqrt(self.variances)
        return table


def _room(voxels: Voxels) -> tuple[Labels, Floats]:
    count = voxels.rows.shape[1]
    return np.empty(count, dtype=np.int32), np.empty(count, dtype=np.float32)


def _fit_one(
    voxels: Voxels, model: BlobModel, predicted: _Blobs, iterations: int
) -> tuple[_Blobs, Labels, float]:
    """K-means from one predicted mixture: the likeliest blobs on the way, the labels (K,) of the voxels nearest to
    each, and their likelihood, nats a voxel.
    """
    labels, distances = _room(voxels)
    before = np.full_like(labels, -1)
    sums = np.empty((len(predicted.means), SUMS))
    blobs, best, best_labels, likelihood = predicted, predicted, before, -np.inf
    for _ in range(iterations + 1):
        assign(voxels.rows, blobs.factors(), labels, distances)
        changed = count_changes(labels, before)
        gather(voxels.rows, voxels.shares, labels, sums)
        found = _likelihood(model, blobs, sums)
        if blobs is not predicted and found <= likelihood:
            break
        best, likelihood, best_labels = blobs, found, labels.copy()
        if changed <= STILL * len(labels):
            break
        held = np.bincount(labels, voxels.shares * voxels.extents, minlength=len(sums))
        blobs = _updated(predicted, sums, np.asarray(held, dtype=np.float64))
    return best, best_labels, likelihood


def _updated(predicted: _Blobs, sums: Array, extents: Array) -> _Blobs:
    """The M-step: what each blob holds (`gather`'s sums; Σ share edge² / 12), the prediction counting a little."""
    prior = PRIOR_SHARE * predicted.weights
    held = sums[:, 0]
    total = (held + prior)[:, None]
    means = (sums[:, 1:4] + prior[:, None] * predicted.means) / total
    second = sums[:, [4, 5, 6, 5, 7, 8, 6, 8, 9]].reshape(-1, 3, 3)
    own = predicted.covariances + _outer(predicted.means)
    covariances = (second + prior[:, None, None] * own) / total[..., None] - _outer(means)
    covariances += (extents / total[:, 0])[:, None, None] * np.eye(3)
    colours = (sums[:, 10:13] + prior[:, None] * predicted.colours) / total
    squares = sums[:, 13:16] + prior[:, None] * (predicted.variances + predicted.colours**2)
    variances = np.maximum(squares / total - colours**2, LEAST_COLOUR_VARIANCE)
    return _Blobs(means, _thick(covariances), colours, variances, total[:, 0] / total.sum())


def _outer(vectors: Array) -> Array:
    return vectors[:, :, None] * vectors[:, None, :]


def _thick(covariances: Array) -> Array:
    """Covariances (B, 3, 3) with no eigenvalue below SMALLEST_VARIANCE."""
    values, axes = np.linalg.eigh(covariances)
    if values.min() >= SMALLEST_VARIANCE:
        return covariances
    return np.einsum("bik,bk,bjk->bij", axes, np.maximum(values, SMALLEST_VARIANCE), axes)


def _likelihood(model: BlobModel, blobs: _Blobs, sums: Array) -> float:
    """Nats a voxel: mean over the volume of ln β + ln N(x; fitted) + ln N(colour; learnt) of each voxel's own blob,
    from what each blob holds (`gather`'s sums), so that it costs no pass over the voxels.
    """
    held = sums[:, 0]
    safe = np.maximum(held, np.finfo(np.float64).tiny)[:, None]
    mean = sums[:, 1:4] / safe
    second = sums[:, [4, 5, 6, 5, 7, 8, 6, 8, 9]].reshape(-1, 3, 3) / safe[..., None]
    about = second - _outer(mean) + _outer(mean - blobs.means)
    spatial = np.einsum("bij,bji->b", np.linalg.inv(blobs.covariances), about)
    spatial += np.linalg.slogdet(blobs.covariances)[1]
    colour = sums[:, 10:13] / safe
    about_colour = sums[:, 13:16] / safe - 2.0 * colour * model.colour + model.colour**2
    coloured = (about_colour / model.colour_variance + np.log(model.colour_variance)).sum(axis=1)
    logs = np.log(blobs.weights) - 0.5 * (6.0 * LOG_TWO_PI + spatial + coloured)
    return float(held @ logs)
