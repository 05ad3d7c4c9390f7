"""A subject (person, animal or machine): its body and size.

A subject file is TOML:

    body = "human31"
    height_mm = 1780
    [lengths_mm]                 # distances of two markers, any number of them
    RHip_RKnee = 420
    [dimensions_mm]              # dimensions of the body itself, used unchanged
    left_foot_length = 260
    [ratios]
    torso_scale_x = 0.88

Rules of the fit (`fit_subject`):
1. `dimensions_mm` and `ratios` are used unchanged.
2. A pair of markers whose distance no pose changes counts fully. One whose distance an ordinary standing
posture
   hardly changes (5 % over 15 degrees in any joint, such as shoulder to shoulder) is read as measured standing
   and decides only what the others leave open. All other pairs, and those that no dimension sets, are
   ignored.
3. The dimensions that set these distances are fitted to them together by least squares. Where fewer equations
than
   dimensions are given, all are scaled alike from the prior, which has equal left and right sides.
4. The prior and all missing dimensions, hands and feet included, are `of_height` times the height: published
   proportions, cited in the body file. Without `height_mm` the height is the median of what the fitted
   dimensions imply; without lengths either, the body keeps its own dimensions.
"""

from collections.abc import Mapping
from pathlib import Path

import msgspec
import numpy as np
import tomli_w
from numpy.typing import ArrayLike

from studio.body.catalogue import load_body, packaged_bodies
from studio.body.dimensions import follows_height, with_dimensions
from studio.body.marker_distances import MarkerDistances
from studio.body.model import BodyModel
from studio.body.scale import scale_of
from studio.foundations.errors import BodyError
from studio.foundations.foreign_files import foreign_file, read_foreign_text
from studio.foundations.typed_decoding import decode_toml

DEFAULT_BODY = "human35"

# Weight of a distance measured standing, relative to one that no pose changes.
STANDING_WEIGHT = 0.03

# Steps of Gauss and Newton; the distances are nearly linear in the dimensions, three suffice.
FIT_STEPS = 20

SHORTEST_MM, TALLEST_MM = 300.0, 3000.0
REPORTED_SPREAD, UNKNOWN_SPREAD = 15.0, 90.0
"""mm: standard deviation of a height that was given, and among people."""
LONGEST_MM = 10_000.0
"""Longest limb or distance of markers, mm; ratios are far below it."""


class Subject(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The known sizes of a subject.

    body : a body's name. height_mm : None where unknown. lengths_mm : "MarkerA_MarkerB" to mm.
    dimensions_mm, ratios : dimension names of the body to their values.
    """

    body: str = DEFAULT_BODY
    height_mm: float | None = None
    lengths_mm: Mapping[str, float] = {}
    dimensions_mm: Mapping[str, float] = {}
    ratios: Mapping[str, float] = {}


def read_subject(path: Path, body: str = DEFAULT_BODY) -> Subject:
    """The subject of a TOML file; `body` is its body where the file names none.

    Raises BodyError naming the file, the entry and the remedy.
    """
    hint = "It holds body, height_mm, [lengths_mm], [dimensions_mm] and [ratios], numbers in mm."
    with foreign_file(path, BodyError, "a subject file", hint):
        text = read_foreign_text(path)
        subject = decode_toml(text, Subject)
        if "body" not in decode_toml(text, dict[str, object]):
            subject = msgspec.structs.replace(subject, body=body)
    _check(subject, f"Subject file {path.name}")
    return subject


def write_subject(subject: Subject, path: Path) -> None:
    """Write a file that `read_subject` reads back; what is unknown is left out."""
    entries = {
        key: value for key, value in msgspec.structs.asdict(subject).items() if value not in (None, {})
    }
    path.write_text(tomli_w.dumps(entries), encoding="utf-8")


def enlarged(subject: Subject, share: float) -> Subject:
    """The subject with all its measures larger by a share; ratios stay."""

    def times(measures: Mapping[str, float]) -> dict[str, float]:
        return {name: (1.0 + share) * value for name, value in measures.items()}

    height = None if subject.height_mm is None else (1.0 + share) * subject.height_mm
    return msgspec.structs.replace(
        subject,
        height_mm=height,
        lengths_mm=times(subject.lengths_mm),
        dimensions_mm=times(subject.dimensions_mm),
    )


def subject_from_shape(body: BodyModel, numbers: ArrayLike) -> Subject:
    """The subject of the body's own shape file: its numbers in the order of the body file's `shape_order`.

    Raises BodyError when the body has no such order or the count is another.
    """
    order = body.definition.shape_order if body.definition else ()
    values = np.asarray(numbers, dtype=float).ravel()
    if not order or len(values) != len(order):
        cause = f"A shape of {len(values)} numbers does not fit body '{body.name}', which takes {len(order)}."
        raise BodyError(cause, "Check that the shape file and the body belong together.")
    lengths, ratios = dict[str, float](), dict[str, float]()
    for name, value in zip(order, values.tolist(), strict=True):
        (ratios if _is_ratio(body, name) else lengths)[name] = value
    subject = Subject(body=body.name, dimensions_mm=lengths, ratios=ratios)
    _check(subject, "The shape")
    return subject


def fit_subject(
    body: BodyModel, subject: Subject, extra_folders: tuple[Path, ...] = ()
) -> tuple[BodyModel, tuple[str, ...]]:
    """The body in the subject's size, and notes on what was ignored or assumed (rules: this file's head).

    body : the tree to size; it need not be the subject's own. Dimensions of another body are turned into
    distances of markers first (`in_lengths`), for which that body is looked up, in extra_folders too. Raises
    BodyError for values that are not positive, and for dimensions that the subject's own body does not have.
    """
    _check(subject, "The subject")
    if subject.body != body.name and (subject.dimensions_mm or subject.ratios):
        subject = in_lengths(subject, load_body(subject.body, extra_folders))
    given = {**subject.dimensions_mm, **subject.ratios}
    notes: list[str] = []
    body = with_dimensions(body, given)
    height = subject.height_mm
    prior = _proportions(body, height, given) if height else _levelled(body, given)
    distances = MarkerDistances(with_dimensions(body, prior))
    measured, ignored = distances.usable(subject.lengths_mm, fixed=frozenset(given))
    notes += ignored
    if not measured:
        return (with_dimensions(body, prior) if height else body), tuple(notes)
    fitted = _fit(distances, measured, frozenset(given))
    if not height:
        height = _implied_height(body, fitted)
        if height:
            notes.append(f"No height_mm was given: {height:.0f} mm follows from the lengths.")
    missing = _proportions(body, height, {**given, **fitted}) if height else {}
    return with_dimensions(body, {**missing, **fitted}), tuple(notes)


def height_spread(body: BodyModel, subject: Subject | None) -> float | None:
    """mm by which the height may be off, of which alone a body's lengths were guessed; None where any was measured,
    where they are no shares of a height, or where a user's own body file says them.

    subject : whose body it is; None where nothing is known.
    """
    if not follows_height(body) or (subject is not None and (subject.lengths_mm or subject.dimensions_mm)):
        return None
    if subject is not None and subject.height_mm:
        return REPORTED_SPREAD
    usual = body.name in packaged_bodies() and load_body(body.name).dimensions == body.dimensions
    return UNKNOWN_SPREAD * scale_of(body) if usual else None


def in_lengths(subject: Subject, own_body: BodyModel) -> Subject:
    """The same subject with its dimensions as marker distances, to which another body can be fitted.

    own_body : the body that `subject.dimensions_mm` belong to.
    """
    sized, _ = fit_subject(own_body, msgspec.structs.replace(subject, body=own_body.name))
    lengths = {**MarkerDistances(sized).rigid(), **subject.lengths_mm}
    return Subject(subject.body, subject.height_mm, lengths)


def _check(subject: Subject, where: str) -> None:
    height = subject.height_mm
    if height is not None and not SHORTEST_MM <= height <= TALLEST_MM:
        raise BodyError(
            f"{where}: height_mm is {height:g}.",
            f"Give the height in millimetres, from {SHORTEST_MM:g} to {TALLEST_MM:g}, or leave it out.",
        )
    for group in ("lengths_mm", "dimensions_mm", "ratios"):
        for name, value in getattr(subject, group).items():
            allowed = value > 0.0 or (group == "dimensions_mm" and value == 0.0)
            if not (value <= LONGEST_MM and allowed):
                raise BodyError(
                    f"{where}: {group} entry '{name}' is {value:g}.",
                    f"Give a number above 0, up to {LONGEST_MM:g}.",
                )


def _is_ratio(body: BodyModel, name: str) -> bool:
    return body.definition is not None and body.definition.dimensions[name].ratio is not None


def _proportions(body: BodyModel, height: float, known: Mapping[str, float]) -> dict[str, float]:
    """Every dimension with published proportions that is not known, mm."""
    entries = body.definition.dimensions if body.definition else {}
    shares = {name: entry.of_height for name, entry in entries.items() if name not in known}
    return {name: share * height for name, share in shares.items() if share is not None}


def _levelled(body: BodyModel, given: Mapping[str, float]) -> dict[str, float]:
    """The body's own dimensions with the mean of left and right on either side, unless they were given."""
    levelled: dict[str, float] = {}
    for name, value in body.dimensions.items():
        other = name.replace("left_", "right_") if "left_" in name else name.replace("right_", "left_")
        if other != name and other in body.dimensions and name not in given and other not in given:
            levelled[name] = 0.5 * (value + body.dimensions[other])
    return levelled


def _fit(
    distances: MarkerDistances, measured: dict[str, tuple[float, bool]], fixed: frozenset[str]
) -> dict[str, float]:
    """Dimensions (mm) that meet the measured distances in the weighted least squares, from those of the body.

    measured : pair to (mm, whether no pose changes it). With x the dimensions, each step solves for relative
    changes scaled by √x, whose least norm scales all undetermined dimensions alike.
    """
    pairs = list(measured)
    measured_mm = np.array([measured[pair][0] for pair in pairs])
    weights = np.array([1.0 if measured[pair][1] else STANDING_WEIGHT for pair in pairs])
    slopes = distances.slopes(pairs, distances.start)
    moving = [name for name in distances.names if np.any(slopes[:, distances.index[name]])]
    free = [name for name in moving if name not in fixed]
    columns = [distances.index[name] for name in free]
    values = distances.start.copy()
    for _ in range(FIT_STEPS):
        roots = np.sqrt(values[columns])
        slopes = distances.slopes(pairs, values)[:, columns]
        remaining = weights * (measured_mm - distances.distances(pairs, values))
        change, *_ = np.linalg.lstsq(weights[:, None] * slopes * roots, remaining, rcond=1e-9)
        # A dimension at most halves or doubles in a step: none becomes zero or negative.
        values[columns] *= np.clip(1.0 + change / roots, 0.5, 2.0)
    return {name: float(values[distances.index[name]]) for name in free}


def _implied_height(body: BodyModel, fitted: Mapping[str, float]) -> float | None:
    """The median height over the fitted dimensions that have published proportions, mm."""
    shares = _proportions(body, 1.0, {})
    heights = [value / shares[name] for name, value in fitted.items() if shares.get(name)]
    return float(np.median(heights)) if heights else None
