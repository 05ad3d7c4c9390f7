"""Rates of each layer are read and checked."""

import pytest

from studio.foundations.errors import SettingsError
from studio.foundations.knobs import changed
from studio.search.trackers.settings import AnnealedSettings, layer_survivals


def test_one_rate_holds_for_all_layers() -> None:
    assert layer_survivals(AnnealedSettings(survival=0.4), 3) == (0.4, 0.4, 0.4)


@pytest.mark.parametrize("text", ["0.6,0.5", "0.6, 0.5,", " 0.6 0.5 "])
def test_a_list_goes_on_with_its_last_rate(text: str) -> None:
    settings = AnnealedSettings(survival_per_layer=text)
    assert layer_survivals(settings, 4) == (0.6, 0.5, 0.5, 0.5)
    assert layer_survivals(settings, 1) == (0.6,)


@pytest.mark.parametrize("text", ["half", "0.5;0.4", "1.5", "0.5,0", "nan", "0.5,-0.2"])
def test_text_that_is_no_list_is_refused(text: str) -> None:
    with pytest.raises(SettingsError, match="survival_per_layer"):
        changed(AnnealedSettings(), {"survival_per_layer": text})
