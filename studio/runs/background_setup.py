"""Sets up a session's masks: the background, its knobs and the excluded regions.

Sources: "plate" and "clip" (as given), "median" (of the footage), "combined" (plate and footage by region,
`evidence.combined_background`; with three cameras or more cleaned by the other views, `runs.clean_plates`).
Knobs that the user did not set can be tuned: the setting under which the views agree best in the visual hull wins,
which needs no ground truth (`runs.mask_quality`).
"""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import msgspec
import numpy as np
from numpy.typing import NDArray

from studio.capture.footage import Footage
from studio.capture.pictures import is_picture, png_of
from studio.errors import FootageError
from studio.evidence.backgrounds import Backgrounds
from studio.evidence.masks import PackedMask, reduced, uncleaned
from studio.evidence.pipeline import EvidenceMaker, RawMask
from studio.evidence.settings import EvidenceSettings
from studio.geometry.camera import Camera
from studio.progress import Progress, unheard
from studio.runs.clean_plates import clean_plates
from studio.runs.mask_quality import JUDGED_SIDE, ROUGH, MaskQuality, count_frame, spread_frames, summed
from studio.runs.session_settings import session_settings
from studio.sessions.background_files import (
    EVIDENCE_NAME,
    Knob,
    given_backgrounds,
    read_evidence,
    set_exclusion,
    use_cleaned,
    write_evidence,
)
from studio.sessions.session import Session, described_anew
from studio.settings import changed_settings

Bytes = NDArray[np.uint8]

SOURCES = ("plate", "clip", "median", "combined")
MODEL_OF = {"plate": "gaussian", "clip": "gaussian", "median": "median", "combined": "combined"}
CLEANING_VIEWS = 3
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
TRIED_CLEANING = ((1.0, 0), (2.0, 0), (2.0, 1))
"""Tried with the best of these: cleaning of gaps, holes and pieces as a multiple of what the picture's size requires,
and the number of pieces kept (0: as before)."""
USUAL_SIDE = 480.0
"""Shorter side (pixels) of the pictures that the default cleaning knobs suit."""
HOLE_AREA = 4.0
"""Factor on the default area of holes and pieces: a belt in the background's colour is wider than noise."""


@dataclass(frozen=True, slots=True)
class BackgroundSetup:
    """The background that was set. knobs : of the session's evidence. notes : for the user. quality : None if
    unmeasured.
    """

    source: str
    knobs: dict[str, Knob]
    notes: tuple[str, ...]
    quality: MaskQuality | None


def set_up_background(
    session: Session,
    source: str,
    *,
    knobs: Mapping[str, Knob] | None = None,
    tune: bool = True,
    exclude_unused: bool = False,
    progress: Progress = unheard,
) -> BackgroundSetup:
    """Set a session's background and store it. knobs : of the masks, fixed. tune : try values for the others.

    exclude_unused : also exclude regions that no hull comes near in any frame (only where backgrounds are cleaned;
    existing exclusions stay). On failure or cancellation the session's backgrounds and knobs are unchanged. Raises
    FootageError for a missing source, SettingsError for an invalid knob.
    """
    _check_source(session, source)
    chosen = dict(knobs or {})
    session_settings(session, changes=chosen)
    manifest, evidence = session.manifest, read_evidence(session)
    had_evidence = (session.path / EVIDENCE_NAME).exists()
    try:
        return _set_up(session, source, chosen, tune, exclude_unused, progress)
    except BaseException:
        described_anew(session, manifest)
        if had_evidence:
            write_evidence(session, evidence)
        else:
            (session.path / EVIDENCE_NAME).unlink(missing_ok=True)
        raise


def _set_up(
    session: Session,
    source: str,
    chosen: dict[str, Knob],
    tune: bool,
    exclude_unused: bool,
    progress: Progress,
) -> BackgroundSetup:
    """`set_up_background` with checked arguments."""
    session = given_backgrounds(session)
    notes: list[str] = []
    model = MODEL_OF[source]
    if source == "combined" and len(session.manifest.footage.cameras) >= CLEANING_VIEWS:
        settings = _settings(session, {"background_model": "combined", **chosen})
        plates = clean_plates(session, settings, progress=progress)
        session = use_cleaned(session, {name: plate.picture for name, plate in plates.items()})
        model = "gaussian"
        for name, plate in plates.items():
            notes.append(f"{name}: {100.0 * plate.never_empty:.0f} % of the picture was never seen empty.")
            if exclude_unused and not (session.path / "exclusions" / f"{name}.png").exists():
                set_exclusion(session, name, png_of(plate.never_taken))
    own: dict[str, Knob] = {"background_model": model, **chosen}
    quality = None
    if tune and len(session.manifest.footage.cameras) > 1:
        own, quality = _tuned(session, own, progress)
    write_evidence(session, msgspec.structs.replace(read_evidence(session), knobs=own))
    return BackgroundSetup(source, own, tuple(notes), quality)


def _tuned(session: Session, own: dict[str, Knob], report: Progress) -> tuple[dict[str, Knob], MaskQuality]:
    """The knobs of TRIALS, then TRIED_CLEANING (`own` stay fixed) whose worst camera agrees best, and its quality."""
    cameras, footage = session.cameras(), session.footage()
    small = tuple(camera.reduced(JUDGED_SIDE) for camera in cameras)
    try:
        trying = _Trying(session, footage, cameras, report)
        trials: list[dict[str, Knob]] = [{**trial, **own} for trial in TRIALS]
        trying.look(trials)

        def tried(knobs: dict[str, Knob]) -> tuple[float, dict[str, Knob], MaskQuality]:
            counted = [
                count_frame(masks, small, blame=False, fineness=ROUGH) for masks in trying.masks(knobs, small)
            ]
            found = summed(trying.frames, tuple(camera.name for camera in cameras), counted)
            worst = min((0.0 if view.agreement != view.agreement else view.agreement) for view in found.views)
            return round(worst, 9), knobs, found

        best = max(map(tried, trials), key=lambda one: one[0])
        side = min(min(camera.width, camera.height) for camera in cameras)
        cleaned = [{**best[1], **_cleaning(side, more, pieces), **own} for more, pieces in TRIED_CLEANING]
        best = max(best, *map(tried, cleaned), key=lambda one: one[0])
    finally:
        footage.close()
    return best[1], best[2]


class _Trying:
    """Masks of a few frames under several sets of knobs. The footage is read once, a camera at a time; the masks before
    cleaning are kept, packed.
    """

    def __init__(
        self, session: Session, footage: Footage, cameras: tuple[Camera, ...], report: Progress
    ) -> None:
        self.frames = spread_frames(footage.frame_count, TRIED_FRAMES)
        self._session, self._footage, self._cameras, self._report = session, footage, cameras, report
        self._backgrounds = Backgrounds(footage)
        self._raw: dict[EvidenceSettings, dict[tuple[int, str], tuple[PackedMask, bool]]] = {}
        self._tried, self._total = 0, len(TRIALS) + len(TRIED_CLEANING)

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
                    raw = maker.raw_mask(camera.name, frame, picture)
                    self._raw[key][frame, camera.name] = PackedMask(raw.mask), raw.to_clean
            self._footage.release(camera.name)
            self._backgrounds.release(camera.name)

    def masks(self, knobs: Mapping[str, Knob], small: tuple[Camera, ...]) -> Iterator[list[Bytes]]:
        """Each frame's masks under some knobs, at the resolution of `small`."""
        self._report("trying knobs", self._tried, self._total)
        self._tried += 1
        settings = _settings(self._session, knobs)
        maker, raw = self._maker(settings), self._raw[uncleaned(settings)]
        for frame in self.frames:
            found = []
            for camera, lens in zip(self._cameras, small, strict=True):
                packed, to_clean = raw[frame, camera.name]
                mask = maker.finished_mask(camera.name, RawMask(packed.unpacked(), to_clean))
                found.append(reduced(mask, lens))
            yield found

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


def _check_source(session: Session, source: str) -> None:
    if source not in SOURCES:
        raise FootageError(
            f"There is no background source '{source}'.", f"Choose one of {', '.join(SOURCES)}."
        )
    evidence = read_evidence(session)
    for camera in session.manifest.footage.cameras:
        path = evidence.given.get(camera.name, camera.background)
        if source in ("plate", "clip") and not path:
            raise FootageError(
                f"Camera {camera.name} has no {source}.", "Give one with --plates, or choose the median."
            )
        if path and source in ("plate", "clip") and is_picture(session.path / path) != (source == "plate"):
            kind = "picture" if source == "clip" else "video"
            raise FootageError(
                f"The background of camera {camera.name} is a {kind}, no {source}.", "Choose the other."
            )
