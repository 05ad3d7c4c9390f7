"""Where cameras should stand, through the API: what is known, and a job that finds out more."""

from collections.abc import Sequence

import numpy as np
import pytest
from waiting import until
from web_doubles import Studio

from studio.foundations.progress import Progress
from studio.results.inspection.reading import InspectedRun
from studio.results.rig import study as rig_study
from studio.results.uncertainty import half_widths
from studio.results.uncertainty.twin import TwinCamera, TwinErrors, points_of
from studio.sessions.stored_run import StoredRun

RUN = "/api/sessions/take1/runs/first"


class QuickTwins:
    """Twins whose errors are 10 mm along each axis."""

    def __init__(self, run: InspectedRun, frames: range, progress: Progress) -> None:
        self.size = (len(frames), len(points_of(run.body)))

    def track(self, progress: Progress, rig: Sequence[TwinCamera], *, seed: int = 0) -> TwinErrors:
        return TwinErrors(np.full((*self.size, 3), 10.0), np.tile(np.eye(3), (*self.size, 1, 1)), ())

    def close(self) -> None:
        pass


def test_a_rig_is_studied_in_a_job_that_is_found_again(
    studio: Studio, tracked: StoredRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = studio.get(f"{RUN}/rig")
    assert before["study"] is None
    assert before["words"] == ["What errors to expect of this rig has not been measured: start that job."]
    refused = studio.post(f"{RUN}/rig", {}, code=409)
    assert refused["message"].startswith(
        "Where cameras should stand cannot be said from run 'first': it has 2"
    )
    assert refused["hint"]
    monkeypatch.setattr(half_widths, "FEWEST_FRAMES", 2)
    monkeypatch.setattr(rig_study, "Twins", QuickTwins)
    begun = studio.post(f"{RUN}/rig", {"best": 1, "add": ["0,4000,1500"]}, code=202)
    address = f"/api/rig/{begun['identifier']}"
    until(lambda: studio.get(address)["state"] in ("done", "failed"))
    assert studio.get(address)["state"] == "done", studio.get(address)
    [line] = studio.get("/api/jobs", params={"kind": "rig"})["jobs"]
    assert (line["at"], line["page"]) == (address, "/rig?session=take1&run=first")
    known = studio.get(f"{RUN}/rig")
    assert known["stale"] == ""
    present, added, best = known["study"]["rigs"]
    assert present["tracked"] == pytest.approx(10.0 * np.sqrt(3.0))
    assert (added["kind"], added["tracked"]) == ("changed", None)
    assert added["cameras"][2]["place"] == pytest.approx([0.0, 4000.0, 1500.0])
    assert best["name"] == "best 1 place beside the present cameras"
    assert [one["order"] for one in known["study"]["places"] if one["order"]] == [1]
    for wrong in ({"best": 13}, {"add": ["0,0"]}, {"move": ["cam1"]}, {"spacing": 0}, {"frames": 3}):
        studio.post(f"{RUN}/rig", wrong, code=422)


def test_what_a_request_says_wrongly_is_refused_at_once(
    studio: Studio, tracked: StoredRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(half_widths, "FEWEST_FRAMES", 2)
    monkeypatch.setattr(rig_study, "Twins", QuickTwins)
    refused = studio.post(f"{RUN}/rig", {"leave_out": True}, code=409)
    assert refused["message"].startswith("None of 2 cameras can be left out")
    refused = studio.post(f"{RUN}/rig", {"move": ["cam9=0,0,0"]}, code=409)
    assert "Camera 'cam9' is none of run 'first'" in refused["message"]
    assert studio.get("/api/jobs", params={"kind": "rig"})["jobs"] == []
