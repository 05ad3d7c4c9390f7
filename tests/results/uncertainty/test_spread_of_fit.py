"""By how much the height of a twin's body may be off is read from what its run fitted."""

from studio.body.catalogue import load_body
from studio.body.dimensions import with_dimensions
from studio.body.subject import DEFAULT_BODY, REPORTED_SPREAD, UNKNOWN_SPREAD, Subject, fit_subject
from studio.results.uncertainty.twin import spread_of_fit


def test_a_twin_fits_lengths_as_freely_as_its_run_did():
    unknown = load_body(DEFAULT_BODY)
    reported, _ = fit_subject(unknown, Subject(body=DEFAULT_BODY, height_mm=1820.0))

    def spread(body, changed):
        return spread_of_fit(body, {**body.dimensions, changed: body.dimensions[changed] * 1.1})

    assert spread(unknown, "left_thigh_length") == UNKNOWN_SPREAD
    assert spread(reported, "left_thigh_length") == REPORTED_SPREAD
    # What no tape measures is fitted to measured people, too.
    assert spread(reported, "thigh_radius_start") is None
    again = with_dimensions(unknown, dict(reported.dimensions))
    assert spread(again, "left_thigh_length") == REPORTED_SPREAD
