"""What the four places that say whether a frame fits say of a stored run: none may contradict another."""

from studio.app.scene.model import LiveSearch
from studio.app.scene.opened_run import OpenedRun
from studio.operations.stored_frames import frame_detail, frames_summary
from studio.results.inspection.limbs import limb_rows
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.tables import Selection
from studio.results.inspection.why import rows
from studio.runs.tracks import RAW
from studio.search.trackers.tracker import RECOVERED, TRACKED

FITTING = ("fits", "mended", "drifting")


def check_that_all_agree(run: InspectedRun, track: str = RAW, why: tuple[int, ...] | None = None) -> None:
    """Timeline, heat map, badge and Why (of frames `why`; None: all) of a run, against one another."""
    lines = frames_summary(run.session, run.run, track).frames
    assert lines
    heat = limb_rows(run, Selection(track=track))["limbs"]
    scene = OpenedRun(run.session, run.run)
    try:
        for line in lines:
            lost = {*line.lost_limbs, *line.limbs_off}
            assert {row[1] for row in heat if row[0] == line.frame and row[4]} == lost
            assert all(bool(row[5]) == bool(row[4]) for row in heat)
            assert line.lost == bool(line.lost_limbs)
            assert line.fits == (line.tracking in (TRACKED, RECOVERED) and not lost)
            detail = frame_detail(run.session, run.run, line.frame)
            assert (detail.tracking, detail.limbs_lost) == (line.tracking, line.limbs_off)
            assert scene.moment(line.frame, LiveSearch(), track=track).tracking == line.tracking
            if why is None or line.frame in why:
                _check_why(run, track, line.frame, line.fits, lost)
    finally:
        scene.close()


def _check_why(run: InspectedRun, track: str, frame: int, fits: bool, lost: set[str]) -> None:
    found = rows(run.frame(frame), Selection(track=track))
    first = found.findings[0]
    assert found.notes[0].startswith("Compared here: ")
    if fits:
        assert "Lost" not in first.words, first.words
        assert first.kind in (*FITTING, "wrong limb")
    else:
        assert first.kind not in FITTING, first.words
        assert "fits" not in first.words, first.words
        assert found.remedies
        for limb in lost:
            assert limb in first.words, first.words
