"""Sets up a session's masks: the background, its knobs and the excluded regions.

Sources: "plate" and "clip" (as given), "median" (of the footage), "combined" (plate and footage by region,
`evidence.combined_background`; with three cameras or more cleaned by the other views, `runs.setup.clean_plates`),
"animal" (before a known background, without shadow and reflection, `runs.setup.animal_masks`);
without any background "person" (masks that a network makes, `runs.setup.person_masks`), "strokes" (of anything, from
a few brush strokes, `runs.setup.stroke_masks`), "threshold" (by brightness and colour) and "masks" (which came with
the footage). "best" tries all of these and takes the best of each camera (`runs.setup.best_source`). Of several
subjects in view all are cut out but one, if its place is given; "subject" does only that, to the masks in use
(`runs.setup.subject_masks`). Knobs that the user did not set can be tuned: the setting under which the views agree
best in the visual hull wins, which needs no ground truth (`runs.setup.mask_quality`).
"""

import dataclasses
import itertools
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from functools import partial
from typing import Literal, get_args

import msgspec
import numpy as np

from studio.body.scale import scale_of
from studio.evidence.backgrounds import FEWEST_FRAMES, Backgrounds
from studio.evidence.frame_evidence import ViewEvidence
from studio.evidence.masks import reduced, uncleaned
from studio.evidence.pipeline import EvidenceMaker, PackedRaw
from studio.evidence.settings import EvidenceSettings
from studio.evidence.strokes import Stroke
from studio.evidence.volume.reconstruction import MOST_VIEWS, check_views
from studio.footage.capture.footage import Footage
from studio.footage.capture.footage_source import FootageSource
from studio.footage.capture.pictures import is_picture, png_of
from studio.foundations.arrays import Bytes
from studio.foundations.errors import (
    CalibrationError,
    FootageError,
    RunError,
    SessionError,
    StudioError,
    WorkCancelledError,
)
from studio.foundations.geometry.camera import Camera
from studio.foundations.progress import Progress, no_progress
from studio.foundations.words import sentence
from studio.runs.setup.animal_masks import animal_masks
from studio.runs.setup.best_source import SampledMasks, SourceChoice, can_be_subject, choose_sources
from studio.runs.setup.clean_plates import clean_plates
from studio.runs.setup.contrast import border_support, measure_contrast
from studio.runs.setup.mask_quality import FrameCounts, MaskQuality, count_frame, mask_quality, summed
from studio.runs.setup.person_hull import JUDGED_SIDE, ROUGH, spread_frames
from studio.runs.setup.person_masks import person_masks
from studio.runs.setup.projected_masks import projected_masks
from studio.runs.setup.session_settings import masks_of, session_settings
from studio.runs.setup.stroke_masks import check_all_cameras, make_stroke_masks
from studio.runs.setup.subject_masks import Place, make_subject_masks
from studio.runs.setup.things_in_front import find_things_in_front
from studio.search.settings import changed_settings
from studio.sessions.background_files import (
    ANIMAL_MASKS,
    CHOSEN_MASKS,
    EVIDENCE_NAME,
    PERSON_MASKS,
    STROKE_MASKS,
    SUBJECT_MASKS,
    Knob,
    SessionEvidence,
    change_evidence,
    forget_unused_masks,
    given_masks_of,
    made_masks,
    painted_in_front,
    read_evidence,
    set_region,
    use_cleaned,
    use_found_in_front,
    use_given_backgrounds,
    use_given_masks,
    write_evidence,
)
from studio.sessions.manifest import SessionManifest
from studio.sessions.session import Session, changed_meanwhile, redescribe
from studio.sessions.stroke_files import read_strokes, restore_strokes, stored_strokes, write_strokes

BackgroundSource = Literal[
    "plate",
    "clip",
    "median",
    "combined",
    "animal",
    "person",
    "strokes",
    "threshold",
    "masks",
    "best",
    "subject",
]
SOURCES: tuple[BackgroundSource, ...] = get_args(BackgroundSource)


@dataclass(frozen=True, slots=True)
class MaskSource:
    """What masks can be made of. label, help : for a page. lacking : what is to be done where it is not possible.

    model : of the evidence (`background_model`). home : where the studio's own masks of it lie, "" where they are not
    kept. has_knobs : whether knobs of the masks change what becomes of it; those that have none need no background.
    """

    label: str
    help: str
    model: str
    lacking: str = ""
    home: str = ""
    has_knobs: bool = True


MASK_SOURCES: dict[BackgroundSource, MaskSource] = {
    "combined": MaskSource(
        "Combined",
        "Pictures of the empty place where there are any, the footage elsewhere; cleaned with the other views. The "
        "best choice with three cameras or more.",
        "combined",
    ),
    "plate": MaskSource(
        "Picture",
        "A picture of the empty place from each camera, unchanged.",
        "gaussian",
        lacking="Give a picture for every camera below.",
    ),
    "clip": MaskSource(
        "Clip",
        "A short video of the empty place from each camera, unchanged.",
        "gaussian",
        lacking="Give a clip for every camera below.",
    ),
    "median": MaskSource("Median", "The median of the footage. Good if the subject moves about.", "median"),
    "animal": MaskSource(
        "Animal",
        "Before a picture or clip of each camera's empty place: without shadows and reflections in the floor or in "
        "glass, with a tail and legs a few pixels wide; where the place has the animal's colour, other views decide.",
        "auto",
        lacking="Give a picture or clip of the empty place for every camera below, and calibrate the cameras.",
        home=ANIMAL_MASKS,
        has_knobs=False,
    ),
    "person": MaskSource(
        "Person",
        "A network finds the person and cuts him out, frame by frame: no picture of the empty room, and he may stay in "
        "place. People only; the one whom most cameras see.",
        "auto",
        lacking="Calibrate the cameras first: they must agree on who is seen.",
        home=PERSON_MASKS,
        has_knobs=False,
    ),
    "strokes": MaskSource(
        "Strokes",
        "Anything: you paint a few lines inside and outside the subject in one picture of each camera; they are "
        "carried through all frames, and corrected by more strokes in any frame.",
        "auto",
        lacking="Paint strokes on a picture of every camera.",
        home=STROKE_MASKS,
        has_knobs=False,
    ),
    "threshold": MaskSource(
        "Brightness and colour",
        "For a subject that is lit so that these alone tell it from all else: a white mouse on dark litter, a glove of "
        "one colour.",
        "threshold",
    ),
    "masks": MaskSource(
        "Given masks",
        "The masks that came with the footage, unchanged.",
        "mask",
        lacking="No masks came with the footage.",
        has_knobs=False,
    ),
    "subject": MaskSource(
        "One of several",
        "Of those in view you choose one; the others are cut out of the masks in use. For several at once: studio "
        "subjects, studio together.",
        "auto",
        lacking="Calibrate the cameras first: it takes two of them to see where a person stands.",
        home=SUBJECT_MASKS,
        has_knobs=False,
    ),
    "best": MaskSource(
        "Best of all",
        "Each of these that is possible is tried, which takes as long as all of them together; then each camera gets "
        "the one under which the views agree and the masks' borders lie on edges of the picture.",
        "auto",
        lacking="Calibrate the cameras first: by their agreement the sources are compared.",
        home=CHOSEN_MASKS,
    ),
}
"""In the order in which a page offers them."""
CLEANING_VIEWS = 3
MOST_STRETCHES = 6
"""Of frames, named in a note."""
TRIED_FRAMES = 3
TRIALS: tuple[dict[str, Knob], ...] = (
    {},
    {"mask_shadow_test": False},
    {"mask_shadow_test": False, "mask_keep_components": 3},
    {
        "mask_shadow_darkest": 0.75,
        "mask_shadow_colour": 0.03,
        "mask_threshold": 5.0,
        "mask_keep_components": 3,
    },
)
"""Knobs to try, besides those already set. Three pieces, because a gap may cut off the legs."""
THRESHOLDS = (*((level, 255) for level in (60, 90, 120, 150, 180)), *((0, level) for level in (40, 70, 100)))
"""Darkest and brightest of the subject, to try where they are not set; one piece, for much else may be as bright."""
TRIED_CLEANING = ((1.0, 0), (2.0, 0), (2.0, 1))
"""Tried with the best of these: cleaning of gaps, holes and pieces as a multiple of what the picture's size requires,
and the number of pieces kept (0: as before)."""
USUAL_SIDE = 480.0
"""Shorter side (pixels) of the pictures that the default cleaning knobs suit."""
HOLE_AREA = 4.0
"""Factor on the default area of holes and pieces: a belt in the background's colour is wider than noise."""


@dataclass(frozen=True, slots=True)
class BackgroundSetup:
    """The background that was set.

    source : of the masks.
    knobs : of the session's evidence, by name.
    notes : sentences.
    quality : how far the masks agree; None if not measured.
    choice : of "best", which source each camera has.
    """

    source: str
    knobs: dict[str, Knob]
    notes: tuple[str, ...]
    quality: MaskQuality | None
    choice: SourceChoice | None = None


def set_up_background(
    session: Session,
    source: BackgroundSource,
    *,
    knobs: Mapping[str, Knob] | None = None,
    tune: bool = True,
    exclude_unused: bool = False,
    strokes: Sequence[Stroke] | None = None,
    run: str = "",
    subject_at: Place | None = None,
    find_in_front: bool = True,
    progress: Progress = no_progress,
) -> BackgroundSetup:
    """Set a session's background and store it. knobs : of the masks, fixed. tune : try values for the others.

    strokes : to be stored in place of the session's. run : a tracked run, by whose model's projection strokes are
    carried. subject_at : x and y (metres) on the floor where the one stands, in the first frame, whose masks they shall
    be; the others who are in view are cut out of them.

    exclude_unused : also exclude regions that no hull comes near in any frame (only where backgrounds are cleaned;
    existing exclusions stay). find_in_front : look in the new masks for things that stand in front of the subject's
    place, with three calibrated cameras or more; what was painted stays. On failure or cancellation the session's
    backgrounds, masks and knobs are unchanged.
    Raises FootageError for a missing source, SettingsError for an invalid knob, SessionError while a run is being
    tracked whose masks would be made anew.
    """
    _check_source(session, source, read_strokes(session) if strokes is None else strokes)
    _check_subject(session, source, subject_at)
    if (tune or source == "best") and len(session.manifest.footage.cameras) > MOST_VIEWS:
        check_views(session.cameras())
    chosen = dict(knobs or {})
    session_settings(session, changes=chosen)
    manifest, evidence = session.manifest, read_evidence(session)
    had_evidence, had_strokes = (session.path / EVIDENCE_NAME).exists(), stored_strokes(session)
    try:
        if strokes is not None:
            write_strokes(session, strokes)
        wanted = _Wanted(chosen, tune, exclude_unused, run)
        if source == "best":
            made = _set_up_best(session, wanted, progress)
        elif source == "subject":
            made = BackgroundSetup(source, {}, (), None)
        else:
            made = _set_up(session, source, wanted, progress)
            if tune and made.quality is not None and _tells_too_little(made.quality):
                made = _tried_besides(
                    made, made.quality, _set_up_best(Session(session.path), wanted, progress)
                )
        if subject_at is not None:
            made = _cut_to_subject(Session(session.path), subject_at, made, progress)
        if find_in_front and session.is_comparable:
            made = _with_things_in_front(Session(session.path), made, progress)
    except BaseException:
        if strokes is not None:
            restore_strokes(session, had_strokes)
        with suppress(SessionError):
            _put_back_footage(session, manifest.footage)
        if had_evidence:
            write_evidence(session, evidence)
        else:
            (session.path / EVIDENCE_NAME).unlink(missing_ok=True)
        forget_unused_masks(session)
        raise
    forget_unused_masks(Session(session.path))
    return made


def _tells_too_little(quality: MaskQuality) -> bool:
    """Whether the views agree, but a subject of low contrast: about what all masks lack, too."""
    return quality.agreeing and quality.contrast is not None and quality.contrast.low


def _tried_besides(made: BackgroundSetup, quality: MaskQuality, best: BackgroundSetup) -> BackgroundSetup:
    """What "best" made after a source of low contrast, and why it was tried. quality : of the source's masks."""
    assert quality.contrast is not None
    note = f"{sentence(quality.contrast.words)}: every source was tried besides {made.source}."
    return dataclasses.replace(best, notes=(*made.notes, note, *best.notes))


@dataclass(frozen=True, slots=True)
class _Wanted:
    """What was asked for besides the source."""

    knobs: dict[str, Knob]
    tune: bool
    exclude_unused: bool
    run: str


def _set_up(
    session: Session, source: BackgroundSource, wanted: _Wanted, progress: Progress
) -> BackgroundSetup:
    chosen, tune = wanted.knobs, wanted.tune
    notes: list[str] = []
    model = MASK_SOURCES[source].model
    if source == "person":
        notes += _make_person_masks(session, progress)
        session = Session(session.path)
    elif source == "strokes":
        notes += _make_stroke_masks(session, wanted.run, progress)
        session = Session(session.path)
    elif source == "animal":
        _make_animal_masks(session, progress)
        session = Session(session.path)
    elif source == "masks":
        session = use_given_masks(session)
    else:
        session = use_given_backgrounds(session)
    if source == "combined" and len(session.manifest.footage.cameras) >= CLEANING_VIEWS:
        settings = _settings(session, {"background_model": "combined", **chosen})
        plates = clean_plates(session, settings, progress=progress)
        session = use_cleaned(session, {name: plate.picture for name, plate in plates.items()})
        model = "gaussian"
        for name, plate in plates.items():
            notes.append(
                f"{name}: {100.0 * plate.never_empty:.0f} % of the picture are empty in no frame of the footage."
            )
            if wanted.exclude_unused and not (session.path / "exclusions" / f"{name}.png").exists():
                set_region(session, "exclusions", name, png_of(plate.never_taken))
    own: dict[str, Knob] = {"background_model": model, **chosen}
    quality = None
    if tune and not MASK_SOURCES[source].has_knobs:
        quality = _agreement(session, own, progress)
    elif tune and len(session.manifest.footage.cameras) > 1:
        own, quality = _tune(session, own, _trials(source), progress)
    change_evidence(session, knobs=own)
    return BackgroundSetup(source, own, tuple(notes), quality)


def _make_person_masks(session: Session, progress: Progress) -> list[str]:
    """Masks of a person for all frames and cameras, which the session then uses; notes on who was not seen."""
    session.check_idle()
    unseen: dict[str, list[int]] = {}
    with closing(session.footage()) as footage, made_masks(session, PERSON_MASKS) as made:
        for person in person_masks(session.cameras(), footage, progress):
            for camera, mask in person.masks.items():
                made.put(camera, person.frame, mask)
            for camera in person.unseen:
                unseen.setdefault(camera, []).append(person.frame)
    names = [source.name for source in session.manifest.footage.cameras if source.name in unseen]
    return [f"{name}: nobody was seen in {frames_in_words(unseen[name])}." for name in names]


def _make_animal_masks(session: Session, progress: Progress) -> None:
    """Masks of an animal for all frames and cameras, which the session then uses."""
    session.check_idle()
    session = use_given_backgrounds(session)
    cameras, scale = session.cameras(), scale_of(session.body())
    with closing(session.footage()) as footage, made_masks(session, ANIMAL_MASKS) as made:
        empty = {camera.name: Backgrounds(footage).empty_room(camera.name) for camera in cameras}
        pictures = {name: picture for name, picture in empty.items() if picture is not None}
        for frame, masks in animal_masks(cameras, footage, pictures, scale, progress):
            for camera, mask in masks.items():
                made.put(camera, frame, mask)


def _make_stroke_masks(session: Session, run: str, progress: Progress) -> list[str]:
    """Masks of the session's strokes for all frames and cameras, which it then uses; notes on what was taken over."""
    session.check_idle()
    projected = projected_masks(session, run) if run else None
    with made_masks(session, STROKE_MASKS) as made:
        kept = make_stroke_masks(session, read_strokes(session), made, progress, projected)
    count = session.manifest.frame_count
    if all(len(frames) == count for frames in kept.values()):
        return ["The strokes are as they were: the masks made of them are used again."]
    return [
        f"{name}: frame{'s' if len(frames) > 1 else ''} {frames_in_words(frames).partition(' ')[2]} as they were."
        for name, frames in kept.items()
        if frames
    ]


def _cut_to_subject(
    session: Session, place: Place, made: BackgroundSetup, progress: Progress
) -> BackgroundSetup:
    """The session with the masks of one subject in place of all subjects' ones that it has now."""
    lost = make_subject_masks(session, place, progress)
    session = Session(session.path)
    own: dict[str, Knob] = {"background_model": MASK_SOURCES["subject"].model}
    change_evidence(session, knobs=own)
    notes = (*made.notes, *([f"The subject is not seen in {frames_in_words(lost)}."] if lost else []))
    return BackgroundSetup("subject", own, notes, _agreement(session, own, progress), made.choice)


def _with_things_in_front(session: Session, made: BackgroundSetup, progress: Progress) -> BackgroundSetup:
    """The session with the things that its masks show in front of the subject's place, and notes on them. Where cameras
    or masks allow no search, such as for a body of another size, a note says so.
    """
    try:
        found = find_things_in_front(session, painted_in_front(session), progress)
    except (CalibrationError, FootageError) as error:
        note = f"Nothing was looked for in front of the subject: {error.message}"
        return dataclasses.replace(made, notes=(*made.notes, note))
    use_found_in_front(session, found)
    notes = [
        f"{name}: something stands in front of the subject's place ({_share_in_words(thing)} of the picture). What it"
        " hides counts as unknown."
        for name, thing in found.items()
    ]
    return dataclasses.replace(made, notes=(*made.notes, *notes))


def _share_in_words(thing: Bytes) -> str:
    return f"{100.0 * np.count_nonzero(thing) / thing.size:.1f} %"


def candidates(session: Session) -> list[BackgroundSource]:
    """The sources that a session can use, "best" left out, and masks of an animal where people are tracked."""
    sources: list[BackgroundSource] = []
    for source in SOURCES:
        if source in ("best", "subject") or (source == "animal" and scale_of(session.body()) == 1.0):
            continue
        try:
            _check_source(session, source, read_strokes(session))
        except StudioError:
            continue
        if source in ("median", "combined") and session.manifest.frame_count < FEWEST_FRAMES:
            continue
        if source == "combined" and not any(_given_paths(session).values()) and not _cleanable(session):
            continue
        sources.append(source)
    return sources


@dataclass(frozen=True, slots=True, eq=False)
class _SetUp:
    """A session as one source left it. masks : by camera, of the tried frames."""

    manifest: SessionManifest
    evidence: SessionEvidence
    made: BackgroundSetup
    masks: dict[str, SampledMasks]

    def put_back(self, session: Session) -> Session:
        """Leave the session as the source left it."""
        write_evidence(session, self.evidence)
        return _put_back_footage(session, self.manifest.footage)


def _put_back_footage(session: Session, footage: FootageSource) -> Session:
    """Describe the footage of the session, as it is now, so. Raises SessionError where others have changed more of that
    than its masks and backgrounds: theirs stays.
    """
    now = Session(session.path)
    if _filmed(now.manifest.footage) != _filmed(footage):
        raise changed_meanwhile(session, "footage")
    return redescribe(now, msgspec.structs.replace(now.manifest, footage=footage))


def _filmed(footage: FootageSource) -> FootageSource:
    """Without what is set up here."""
    cameras = tuple(dataclasses.replace(one, masks="", background="") for one in footage.cameras)
    return dataclasses.replace(footage, cameras=cameras)


def _set_up_best(session: Session, wanted: _Wanted, progress: Progress) -> BackgroundSetup:
    """Every source set up, one after another; then the best one, or the best one of each camera, is used."""
    session.check_idle()
    manifest, evidence = session.manifest, read_evidence(session)
    frames = spread_frames(session.manifest.frame_count, TRIED_FRAMES)
    small = tuple(camera.reduced(JUDGED_SIDE) for camera in session.cameras())
    tried: dict[str, _SetUp] = {}
    notes: list[str] = []
    for source in candidates(session):

        def report(step: str, done: int, total: int, source: str = source) -> None:
            progress(f"{source}: {step}", done, total)

        try:
            made = _set_up(Session(session.path), source, wanted, report)
        except WorkCancelledError:
            raise
        except (FootageError, RunError) as error:
            notes.append(f"{source}: {error.message}")
            continue
        now = Session(session.path)
        sampled: dict[str, SampledMasks] = {}
        for lens in small:
            views = [view for _, view in _views_of(now, frames, [lens.name], no_progress)]
            border = sum(border_support(view.picture, view.mask) for view in views) / len(views)
            sampled[lens.name] = SampledMasks(tuple(reduced(view.mask, lens) for view in views), border)
        tried[source] = _SetUp(now.manifest, read_evidence(now), made, sampled)
    masks = {source: one.masks for source, one in tried.items()}
    choice = choose_sources(small, frames, masks, progress, scale_of(session.body()))
    notes += [f"{one.source}: {one.in_words()}" for one in choice.tried]
    used = set(choice.by_camera.values())
    if len(used) == 1:
        best = tried[used.pop()]
        best.put_back(session)
        notes.append(f"The best one is {best.made.source}.")
        return dataclasses.replace(best.made, notes=(*notes, *best.made.notes), choice=choice)
    by_source = {source: [name for name, one in choice.by_camera.items() if one == source] for source in used}
    with made_masks(session, CHOSEN_MASKS) as made:
        for source in sorted(used):
            left = tried[source].put_back(session)
            every = range(session.manifest.frame_count)
            for frame, view in _views_of(left, every, by_source[source], progress):
                made.put(view.camera, frame, view.mask)
        # The masks that came with the footage are those of the session as it was found.
        _put_back_footage(session, manifest.footage)
        write_evidence(session, evidence)
    own: dict[str, Knob] = {"background_model": MASK_SOURCES["best"].model}
    now = Session(session.path)
    change_evidence(now, knobs=own)
    notes.append(f"Together: {choice.mixed.in_words()}")
    notes += [f"{name}: masks of {source}." for name, source in choice.by_camera.items()]
    return BackgroundSetup("best", own, tuple(notes), _agreement(now, own, progress), choice)


def _views_of(
    session: Session, frames: Iterable[int], cameras: Sequence[str], progress: Progress
) -> Iterator[tuple[int, ViewEvidence]]:
    """Pictures and the masks that the session makes of them, of some cameras and frames."""
    chosen = list(frames)
    with masks_of(session) as maker:
        for _, frame, view in maker.views(cameras, chosen, partial(progress, "writing the masks")):
            yield frame, view


def frames_in_words(frames: Sequence[int]) -> str:
    """Frames as stretches: "frames 0 to 4, 9, 11 to 12 and 5 more"."""
    ordered = sorted(frames)
    stretches = [
        [frame for _, frame in group]
        for _, group in itertools.groupby(enumerate(ordered), key=lambda pair: pair[1] - pair[0])
    ]
    named = stretches[:MOST_STRETCHES]
    words = ", ".join(f"{one[0]} to {one[-1]}" if len(one) > 1 else f"{one[0]}" for one in named)
    rest = len(ordered) - sum(map(len, named))
    return f"frame{'s' if len(ordered) > 1 else ''} {words}{f' and {rest} more' if rest else ''}"


def _agreement(session: Session, own: Mapping[str, Knob], progress: Progress) -> MaskQuality | None:
    """How far the views agree with masks that need no tuning; None where there is one view, or no calibration."""
    if not session.is_comparable:
        return None
    frames = spread_frames(session.manifest.frame_count, TRIED_FRAMES)
    return mask_quality(session, _settings(session, own), frames, blame=False, progress=progress)


def _trials(source: BackgroundSource) -> tuple[dict[str, Knob], ...]:
    if source != "threshold":
        return TRIALS
    return tuple(
        {"mask_darkest": low, "mask_brightest": high, "mask_keep_components": 1} for low, high in THRESHOLDS
    )


def _tune(
    session: Session, own: dict[str, Knob], wanted: Sequence[dict[str, Knob]], report: Progress
) -> tuple[dict[str, Knob], MaskQuality]:
    """The knobs of the trial, then TRIED_CLEANING (`own` fixed), whose worst camera agrees best; its quality."""
    cameras, footage = session.cameras(), session.footage()
    small = tuple(camera.reduced(JUDGED_SIDE) for camera in cameras)
    scale = scale_of(session.body())
    try:
        trials: list[dict[str, Knob]] = [{**trial, **own} for trial in wanted]
        trying = _Trying(session, footage, cameras, len(trials) + len(TRIED_CLEANING), report)
        trying.look(trials)

        def tried(knobs: dict[str, Knob]) -> tuple[float, dict[str, Knob], MaskQuality]:
            counted: list[FrameCounts] = []
            plausible = True
            for masks in trying.masks(knobs, small):
                plausible = plausible and all(map(can_be_subject, masks))
                counted.append(count_frame(masks, small, blame=False, fineness=ROUGH, scale=scale))
            quality = summed(trying.frames, tuple(camera.name for camera in cameras), counted)
            if not plausible and knobs.get("background_model") == MASK_SOURCES["threshold"].model:
                return 0.0, knobs, quality
            worst = min(
                (0.0 if view.agreement != view.agreement else view.agreement) for view in quality.views
            )
            return round(worst, 9), knobs, quality

        best = max(map(tried, trials), key=lambda one: one[0])
        side = min(min(camera.width, camera.height) for camera in cameras)
        cleaned = [{**best[1], **_cleaning(side, more, pieces), **own} for more, pieces in TRIED_CLEANING]
        best = max(best, *map(tried, cleaned), key=lambda one: one[0])
    finally:
        footage.close()
    contrast = measure_contrast(session, _settings(session, best[1]), progress=report)
    return best[1], dataclasses.replace(best[2], contrast=contrast)


class _Trying:
    """Masks of a few frames under several sets of knobs. The footage is read once, a camera at a time; the masks before
    cleaning are kept, packed.
    """

    def __init__(
        self, session: Session, footage: Footage, cameras: tuple[Camera, ...], total: int, report: Progress
    ) -> None:
        self.frames = spread_frames(footage.frame_count, TRIED_FRAMES)
        self._session, self._footage, self._cameras, self._report = session, footage, cameras, report
        self._backgrounds = Backgrounds(footage)
        self._raw: dict[EvidenceSettings, dict[tuple[int, str], PackedRaw]] = {}
        self._tried, self._total = 0, total

    def look(self, trials: Sequence[Mapping[str, Knob]]) -> None:
        """Read the footage for these trials; later ones may differ from them only in their cleaning."""
        settings = [_settings(self._session, knobs) for knobs in trials]
        makers = {uncleaned(one): self._maker(one) for one in settings}
        self._raw = {key: {} for key in makers}
        for camera in self._cameras:
            for frame in self.frames:
                self._report("trying knobs", 0, self._total)
                picture = self._footage.picture(camera.name, frame)
                for key, maker in makers.items():
                    self._raw[key][frame, camera.name] = PackedRaw(
                        maker.raw_mask(camera.name, frame, picture)
                    )
            self._footage.release(camera.name)
            self._backgrounds.release(camera.name)

    def masks(self, knobs: Mapping[str, Knob], small: tuple[Camera, ...]) -> Iterator[list[Bytes]]:
        """Each frame's masks under some knobs, at the resolution of `small`."""
        self._report("trying knobs", self._tried, self._total)
        self._tried += 1
        settings = _settings(self._session, knobs)
        maker, raw = self._maker(settings), self._raw[uncleaned(settings)]
        for frame in self.frames:
            seen = maker.without_false_shadows(
                {camera.name: raw[frame, camera.name].unpacked() for camera in self._cameras}
            )
            yield [
                reduced(maker.finished(camera.name, seen[camera.name])[0], lens)
                for camera, lens in zip(self._cameras, small, strict=True)
            ]

    def _maker(self, settings: EvidenceSettings) -> EvidenceMaker:
        return EvidenceMaker(self._cameras, self._footage, self._backgrounds, settings, "none")


def _cleaning(side: int, more: float, pieces: int) -> dict[str, Knob]:
    """Cleaning knobs for pictures whose shorter side is `side` pixels."""
    usual, scale = EvidenceSettings(), max(1.0, side / USUAL_SIDE)
    area = HOLE_AREA * scale**2
    knobs: dict[str, Knob] = {
        "mask_closing": round(usual.mask_closing * scale * more),
        "mask_fill_holes": round(usual.mask_fill_holes * area),
        "mask_min_component": round(usual.mask_min_component * area),
    }
    return {**knobs, "mask_keep_components": pieces} if pieces else knobs


def _settings(session: Session, knobs: Mapping[str, Knob]) -> EvidenceSettings:
    """The default evidence settings with these knobs, ignoring the session's own."""
    bare = dataclasses.replace(session_settings(session), evidence=EvidenceSettings())
    return changed_settings(bare, knobs).evidence


def _given_paths(session: Session) -> dict[str, str]:
    """Camera to the path of the background that was given for it, "" for none."""
    given = read_evidence(session).given
    return {one.name: given.get(one.name, one.background) for one in session.manifest.footage.cameras}


def _cleanable(session: Session) -> bool:
    return len(session.manifest.footage.cameras) >= CLEANING_VIEWS and session.is_calibrated


def _check_subject(session: Session, source: str, place: Place | None) -> None:
    if place is None:
        if source == "subject":
            raise FootageError(
                "Nobody was chosen.", "Say where he stands in the first frame: --subject-at X,Y."
            )
        return
    if not all(math.isfinite(value) for value in place):
        raise FootageError("A place has two finite numbers.", "Give x and y on the floor in metres.")
    if not session.is_comparable:
        raise FootageError(
            "Only two calibrated cameras or more can tell where a person stands.",
            "Calibrate the cameras, or exclude the others by hand (--exclude).",
        )
    session.check_idle()


def _check_source(session: Session, source: str, strokes: Sequence[Stroke]) -> None:
    if source not in SOURCES:
        raise FootageError(
            f"There is no background source '{source}'.", f"Choose one of {', '.join(SOURCES)}."
        )
    given_masks = given_masks_of(session)
    if source == "masks" and not all(given_masks.values()):
        bare = next(name for name, path in given_masks.items() if not path)
        raise FootageError(
            f"No masks came with the footage of camera {bare} in session '{session.name}'.",
            "Choose another source.",
        )
    if source == "strokes":
        check_all_cameras(session, strokes)
    if source == "best" and not session.is_comparable:
        raise FootageError(
            "Sources are compared by the agreement of two calibrated cameras or more.",
            "Calibrate the cameras, or choose a source yourself.",
        )
    if source == "animal" and not session.is_comparable:
        raise FootageError(
            "Only two calibrated cameras or more can tell an animal from its reflections.",
            "Calibrate the cameras, or choose another source.",
        )
    given = _given_paths(session)
    for camera in session.manifest.footage.cameras:
        path = given[camera.name]
        if source in ("plate", "clip", "animal") and not path:
            raise FootageError(
                f"Camera {camera.name} has no {'plate' if source == 'animal' else source}.",
                "Give one with --plates, or choose the median.",
            )
        if path and source in ("plate", "clip") and is_picture(session.path / path) != (source == "plate"):
            kind = "picture" if source == "clip" else "video"
            raise FootageError(
                f"The background of camera {camera.name} is a {kind}, no {source}.", "Choose the other."
            )
