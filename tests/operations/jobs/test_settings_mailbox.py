"""Latest wins, all or nothing."""

import pytest

from studio.foundations.errors import SettingsError
from studio.operations.jobs.open_run import SettingsMailbox
from studio.runs.behaviour_models import check_prediction
from studio.search.settings import default_settings


def test_each_change_is_a_version_and_the_newest_is_read() -> None:
    mailbox = SettingsMailbox(3, default_settings())
    assert mailbox.change({"survival": 0.4}) == ("survival",)
    assert set(mailbox.change({"survival": 0.3, "layers": 5})) == {"survival", "layers"}
    version, settings = mailbox.latest()
    assert version == 5
    assert (settings.tracker.survival, settings.tracker.layers) == (0.3, 5)


def test_a_change_to_the_same_value_is_none() -> None:
    mailbox = SettingsMailbox(1, default_settings())
    before = mailbox.latest()
    assert mailbox.change({"survival": before[1].tracker.survival}) == ()
    assert mailbox.latest() is before


@pytest.mark.parametrize(
    "changes",
    [
        {"survival": 0.4, "layers": 0},
        {"survival": 0.4, "speed": 1},
        {"survival": 0.4, "start_repeats": 7},
        {"survival": float("nan")},
    ],
)
def test_what_is_refused_changes_nothing(changes: dict[str, object]) -> None:
    mailbox = SettingsMailbox(1, default_settings())
    before = mailbox.latest()
    with pytest.raises(SettingsError) as caught:
        mailbox.change(changes)
    assert caught.value.hint
    assert mailbox.latest() is before


def test_what_the_run_cannot_do_is_refused_and_changes_nothing() -> None:
    mailbox = SettingsMailbox(
        1, default_settings(), lambda settings: check_prediction(settings, has_model=False)
    )
    before = mailbox.latest()
    with pytest.raises(SettingsError, match="no behaviour model"):
        mailbox.change({"survival": 0.4, "prediction": "behaviour"})
    assert mailbox.latest() is before
    assert mailbox.change({"survival": 0.4}) == ("survival",)
