"""A file that is older than the track it was written from is called old, in the list and on the guided set-up."""

import dataclasses

import pytest
from export_runs import MADE, moving_poses, track_of
from store_records import layer_of, result_of

from studio.operations.exports import export_into_run, exported_files, kept_exports, stale_export
from studio.results.export.formats import FORMATS
from studio.runs.setup.workflow import StepStatus, export_step
from studio.runs.tracks import read_track, write_track
from studio.sessions.results_store import ResultsWriter
from studio.sessions.session import Session


@pytest.fixture
def arm(make_run):
    """A run of the planar arm, 12 frames."""
    return make_run("planar_arm4", lambda body: track_of(moving_poses(body, 12)))


def export_of_way(session: Session, run) -> StepStatus:
    return export_step(session, exported_files(run))


def test_a_file_older_than_its_track_is_stale(arm) -> None:
    session, run = arm
    written = export_into_run(session, run, FORMATS["trc"], {"track": MADE})
    export_into_run(session, run, FORMATS["csv"], {"track": MADE})
    assert [file.stale for file in exported_files(run)] == ["", ""]
    track = read_track(run, MADE)
    write_track(run, track, replace=True)
    assert [stale_export(run, kept) for kept in kept_exports(run)] == ["", ""]
    write_track(run, dataclasses.replace(track, poses=track.poses + 0.01), replace=True)
    trc = next(kept for kept in kept_exports(run) if kept.file == written.file)
    assert stale_export(run, trc) == f"written before track '{MADE}' changed"
    export_into_run(session, run, FORMATS["trc"], {"track": MADE})
    assert {file.name: bool(file.stale) for file in exported_files(run)}[written.file] is False


def test_the_guided_setup_names_the_old_file(arm) -> None:
    session, run = arm
    with ResultsWriter(run.folder) as writer:
        writer.write_frame(result_of(0, layers=1), [layer_of(0, 0)])
    written = export_into_run(session, run, FORMATS["csv"], {"track": MADE})
    track = read_track(run, MADE)
    before = export_of_way(session, run)
    assert (before.state, before.why) == ("done", "")
    write_track(run, dataclasses.replace(track, poses=track.poses * 1.01), replace=True)
    after = export_of_way(session, run)
    assert after.state == "stale"
    assert f"{written.file}: written before track '{MADE}' changed" in after.why
    run.folder.joinpath("tracks", f"{MADE}.npz").unlink()
    assert "no longer exists" in export_of_way(session, run).why


def test_a_file_of_the_best_track_is_old_once_another_is_the_best(arm) -> None:
    session, run = arm
    write_track(run, dataclasses.replace(read_track(run, MADE), name="refined"))
    written = export_into_run(session, run, FORMATS["csv"], {})
    assert written.track == "refined"
    write_track(run, dataclasses.replace(read_track(run, MADE), name="smoothed"))
    assert stale_export(run, written) == "holds track 'refined', and 'smoothed' is the best now"
    assert export_into_run(session, run, FORMATS["csv"], {}).track == "smoothed"
    chosen = export_into_run(session, run, FORMATS["csv"], {"track": "refined"})
    assert stale_export(run, chosen) == ""
