"""A run's particles as xarray, and runs in notebooks."""

import sys

import numpy as np
import pytest
from store_records import layer_of, record_of, result_of

from studio.foundations.errors import RunError, StudioError
from studio.sessions.results_store import ResultsWriter
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
