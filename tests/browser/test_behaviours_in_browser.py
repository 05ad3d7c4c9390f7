"""The page of behaviour models: one is learnt in the background, opens, gets another name, goes and comes back."""

from pathlib import Path

import pytest
from scene_wire import until
from studio_page import StudioPage
from swaying_person import swaying

pytestmark = pytest.mark.browser

FEW = {"most_clusters": "6", "reduced_dimensions": "3", "memory": "3", "smoothings": "2"}


def names(window: StudioPage) -> list[str]:
    """The models there are."""
    return [model["name"] for model in window.studio.get("/api/behaviours")["models"]]


def shoot(window: StudioPage, artefacts: Path, name: str) -> None:
    """Pictures in both themes; nothing reaches beyond the window."""
    page = window.page
    for theme in ("dark", "light"):
        if page.evaluate("document.documentElement.dataset.theme") != theme:
            page.click("#theme")
        window.shoot(artefacts / f"page-behaviours-{name}-{theme}-1280x800.png")
        assert page.evaluate("document.documentElement.scrollWidth") == 1280
        assert page.evaluate("document.documentElement.scrollHeight") == 800
    page.click("#theme")


@pytest.mark.slow
def test_a_model_is_learnt_from_a_file_and_opens(window: StudioPage, artefacts: Path, tmp_path: Path) -> None:
    page = window.page
    page.goto(f"{window.studio.origin}/behaviours")
    page.get_by_role("button", name="Learn one").click()
    form = page.locator(".compare-form")
    form.locator("[name=files]").set_input_files(str(swaying(tmp_path)))
    form.locator("[name=body]").select_option("human31")
    for group in page.locator("summary").all():
        group.click()
    for knob, value in FEW.items():
        form.locator(f"[name={knob}]").fill(value)
    form.locator("[name=name]").fill("sway")
    shoot(window, artefacts, "form")
    page.get_by_role("button", name="Learn", exact=True).click()
    page.locator("#learning, .poses").first.wait_for()
    page.locator(".poses .pose").first.wait_for(timeout=120_000)
    assert "name=sway" in page.url
    (model,) = window.studio.get("/api/behaviours")["models"]
    assert (model["name"], model["memory"], model["sources"]) == ("sway", 3, ["sway"])
    shoot(window, artefacts, "model")
    page.get_by_role("button", name="Generate").click()
    for label in ("Pause", "Play", "Pause"):
        page.get_by_role("button", name=label, exact=True).click()


@pytest.mark.slow
def test_it_gets_another_name_goes_and_comes_back(window: StudioPage) -> None:
    page = window.page
    page.get_by_role("button", name="Rename…").click()
    page.locator("dialog [name=name]").fill("swing")
    page.locator("dialog").get_by_role("button", name="Rename").click()
    until(page, lambda: names(window) == ["swing"])
    page.get_by_role("heading", name="swing").wait_for()
    page.get_by_role("button", name="Delete…").click()
    page.locator("dialog").get_by_role("button", name="Delete").click()
    page.get_by_text("No behaviour learnt yet").wait_for()
    assert names(window) == []
    page.get_by_role("button", name="Restore").click()
    page.get_by_role("heading", name="swing").wait_for()
    assert names(window) == ["swing"]


@pytest.mark.slow
def test_what_cannot_be_learnt_is_reported_in_the_form(window: StudioPage) -> None:
    page = window.page
    window.watch.allow(422, "/api/learning")
    page.click("#new")
    form = page.locator(".compare-form")
    form.locator("[name=name]").fill("swing")
    page.get_by_role("button", name="Learn", exact=True).click()
    form.get_by_text("There is a model").wait_for()
    form.locator("[name=name]").fill("other")
    page.get_by_role("button", name="Learn", exact=True).click()
    form.get_by_text("There is nothing to learn from.").wait_for()
