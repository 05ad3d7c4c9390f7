"""A run's particles as xarray, and runs in notebooks."""

import sys

import numpy as np
import pytest
from store_records import layer_of, record_of, result_of

import studio
from studio.foundations.errors import RunError, StudioError
from studio.sessions.results_store import ResultsWriter
from studio.sessions.run_arrays import inference_data
from studio.sessions.run_record import write_run_record
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun


@pytest.fixture
def stored(session_on_disk: Session) -> StoredRun:
    """A run of two frames with three layers each."""
    record = record_of(session_on_disk, "some")
    folder = session_on_disk.path / "runs" / "some"
    folder.mkdir(parents=True)
    write_run_record(folder, record)
    with ResultsWriter(folder) as writer:
        for frame in range(2):
            writer.write_frame(result_of(frame), [layer_of(frame, layer) for layer in range(3)], 2000)
    return StoredRun(folder)


def test_particles_have_layers_as_a_dimension(stored: StoredRun) -> None:
    found = stored.to_xarray()
    assert dict(found.sizes) == {"frame": 2, "layer": 3, "particle": 12, "parameter": 4, "which": 2}
    for frame in range(2):
        for layer in range(3):
            record = layer_of(frame, layer)
            own = found.sel(frame=frame, layer=layer)
            assert np.array_equal(own["pose"], record.poses)
            assert np.array_equal(own["log_weight"], record.log_weights)
            assert float(own["beta"]) == record.beta
    assert found.attrs["run"] == "some"
    assert stored.to_xarray(frames=[1]).sizes["frame"] == 1


def test_runs_are_chains_of_their_last_clouds(stored: StoredRun) -> None:
    data = studio.inference_data(stored, stored, frames=[0, 1])
    assert {"posterior", "sample_stats", "layers"} <= set(data.groups())
    pose = data.posterior["pose"]
    assert dict(pose.sizes) == {"chain": 2, "draw": 12, "frame": 2, "parameter": 4}
    record = layer_of(1, 2)
    weights = np.exp(record.beta * (record.log_weights - record.log_weights.max()))
    weights /= weights.sum()
    drawn = pose.sel(chain=1, frame=1).to_numpy()
    counts = np.array([(drawn == one).all(axis=1).sum() for one in record.poses])
    assert counts.sum() == 12
    assert np.all(np.abs(counts - 12.0 * weights) < 1.0)
    assert np.isin(data.sample_stats["lp"].sel(chain=0, frame=1), record.log_weights).all()
    assert list(data.posterior["seed"]) == [stored.record.seed] * 2
    assert data.layers.sizes["layer"] == 3
    assert np.array_equal(data.layers["beta"].sel(chain=0), stored.to_xarray()["beta"])


def test_runs_that_do_not_fit_together_are_no_chains(stored: StoredRun) -> None:
    other = stored.to_xarray().isel(parameter=slice(0, 3))
    with pytest.raises(RunError, match="differ in their parameters"):
        inference_data([stored.to_xarray(), other])
    with pytest.raises(RunError, match="No run is named"):
        studio.inference_data()


def test_without_xarray_the_error_says_what_to_install(
    stored: StoredRun, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(StudioError) as caught:
        stored.to_xarray()
    assert "capture-studio[notebook]" in caught.value.hint


def test_a_run_without_frames_has_no_arrays(stored: StoredRun) -> None:
    with pytest.raises(RunError):
        stored.to_xarray(frames=[])


def test_a_run_is_a_table_in_a_notebook(stored: StoredRun) -> None:
    shown = stored._repr_html_()
    assert "toy / some" in shown
    assert shown.startswith("<table>")
