"""A run as one page: everything inside, its numbers those of the store, of a size that is bounded."""

import base64
import json
import re
from pathlib import Path

import numpy as np
import pytest
from html_page import HtmlPage

import studio
from studio.body.forward_kinematics import limb_ends
from studio.body.model import extremities
from studio.foundations.errors import NotFoundError, RunError, SessionError
from studio.foundations.package import INSTALLED_ASSETS
from studio.results.inspection import shared_page as room
from studio.results.inspection.limbs import errors_of
from studio.results.inspection.reading import InspectedRun
from studio.results.inspection.shared_page import shared_page
from studio.runs.tracks import RAW, read_track


def data_of(text: str) -> dict:
    return json.loads(HtmlPage(text).scripts["application/json"])


@pytest.fixture(scope="module")
def text(run: InspectedRun) -> str:
    return shared_page(run, 3)


@pytest.fixture(scope="module")
def data(text: str) -> dict:
    return data_of(text)


def test_nothing_is_elsewhere(text: str) -> None:
    page = HtmlPage(text)
    assert page.addresses == []
    assert all(address.startswith("data:") for address in re.findall(r'url\("?([^")]{0,40})', text))
    modules = json.loads(page.scripts["importmap"])["imports"]
    assert set(re.findall(r'from "([^"]+)"', page.scripts["module"])) <= set(modules)
    for name, address in modules.items():
        source = base64.b64decode(address.partition(",")[2]).decode()
        assert set(re.findall(r'^import [^"]*"([^"]+)"', source, re.MULTILINE)) <= set(modules), name
        # The drawings share modules with the studio's pages; in Chromium none of them asks for anything.
        assert "fetch(" not in source or name in ("vendor/echarts.esm.min.js", "js/api.js"), name
    assert len(text) < 3_000_000


def test_its_numbers_are_those_of_the_store(run: InspectedRun, data: dict) -> None:
    assert (data["session"], data["run"], data["frame"]) == (run.session.name, "small", 3)
    assert data["caption"] == run.caption()
    figures = {(entry["view"], entry["of"]): entry for entry in data["figures"]}
    assert set(figures) == {
        ("frames", "run"), ("why", "run"), ("variance", "run"), ("schedule", "run"),
        ("variance", "frame"), ("schedule", "frame"),
    }  # fmt: skip
    assert all(entry["caption"] for entry in data["figures"])
    (frames,) = figures["frames", "run"]["tables"]
    keys = [column["key"] for column in frames["columns"]]
    with run.run.results() as results:
        line = results.timeline()
    assert [row[0] for row in frames["rows"]] == line.frames.tolist()
    assert [row[keys.index("log_weight")] for row in frames["rows"]] == pytest.approx(
        line.log_weights.tolist(), rel=1e-5
    )
    errors = errors_of(run)
    limbs = figures["why", "run"]["tables"][0]
    for row in limbs["rows"]:
        assert row[2] == (pytest.approx(errors[row[0]][row[1]], rel=1e-5) if errors else None)
    settings = {entry["name"]: entry for entry in data["settings"]}
    assert settings["particles"]["value"] == run.run.record.settings["particles"]
    assert settings["layers"]["moved"] is True
    assert data["why"]["findings"]
    parameter = next(t for t in figures["variance", "run"]["tables"] if t["name"] == "parameter")
    assert parameter["rows"]
    assert data["parameter"] in run.names


def test_the_bodies_are_those_of_the_track(run: InspectedRun, data: dict) -> None:
    scene, track = data["scene"], read_track(run.run, RAW)
    ends = limb_ends(run.body, track.poses)
    packed = np.frombuffer(base64.b64decode(scene["ends"]), "<i2").reshape(ends.shape)
    assert scene["frames"] == track.frames.tolist()
    assert np.abs(packed * scene["step"] + scene["offset"] - ends).max() <= 0.5 * scene["step"] + 1e-6
    assert len(scene["limbs"]) == ends.shape[1]
    camera = run.run.cameras()[0]
    drawn = scene["cameras"][0]
    assert drawn["centre"] == pytest.approx(camera.centre, abs=0.1)
    middle = camera.rotation @ np.mean(drawn["corners"], axis=0) + camera.translation
    assert middle[2] == pytest.approx(room.CAMERA_DEPTH, abs=0.2)


def test_a_long_run_is_thinned_evenly_and_says_so(run: InspectedRun, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "MOST_FRAMES", 3)
    data = data_of(shared_page(run, 3))
    first, last = run.frames()[0], run.frames()[-1]
    assert data["scene"]["frames"] == sorted({first, 3, last})
    assert all(
        {row[0] for row in table["rows"]} <= {first, 3, last}
        for entry in data["figures"]
        if entry["of"] == "run"
        for table in entry["tables"]
        if table["columns"][0]["key"] == "frame"
    )
    assert any("evenly chosen" in note for note in data["notes"])


def test_words_of_a_person_do_not_end_the_script(run: InspectedRun, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(
        InspectedRun, "caption", lambda self, frame=None: "</script><script>alert(1)</script>"
    )
    text = shared_page(run, 3)
    assert "alert(1)</script>" not in text
    assert data_of(text)["caption"].startswith("</script>")


def test_the_verb_writes_the_page_and_names_what_is_wrong(run: InspectedRun, tmp_path: Path) -> None:
    made = studio.share(run.run, tmp_path / "page.html")
    assert made.size == (tmp_path / "page.html").stat().st_size
    assert data_of((tmp_path / "page.html").read_text(encoding="utf-8"))["frame"] == made.frame
    assert studio.share(run.run, tmp_path / "page.html", frame=2).frame == 2
    with pytest.raises(NotFoundError, match="no finished frame 99"):
        studio.share(run.run, tmp_path / "other.html", frame=99)
    with pytest.raises(NotFoundError, match="track"):
        studio.share(run.run, tmp_path / "other.html", track="smoothed")
    with pytest.raises(SessionError):
        studio.share(run.run, tmp_path / "nowhere" / "page.html")
    assert not (tmp_path / "other.html").exists()


def test_installed_pages_are_looked_for_where_the_wheel_has_them() -> None:
    build = (Path(__file__).resolve().parents[3] / "hatch_build.py").read_text()
    assert f'"web_assets": "studio/{INSTALLED_ASSETS}"' in build


def test_the_particles_of_chosen_frames_are_those_of_the_store(run: InspectedRun) -> None:
    """Where the extremities of each are, in which layer, of which parent; and only of the frames that were named."""
    clouds = data_of(shared_page(run, 3, clouds=(1,)))["clouds"]
    assert [cloud["frame"] for cloud in clouds] == [1, 3]
    tips = list(extremities(run.body))
    for cloud in clouds:
        records = run.frame(cloud["frame"]).layers
        assert [layer["layer"] for layer in cloud["layers"]] == [record.layer for record in records]
        for before, record, layer in zip((None, *records), records, cloud["layers"], strict=False):
            numbers = np.frombuffer(base64.b64decode(layer["points"]), dtype="<i2")
            places = numbers.reshape(-1, len(tips), 3) * cloud["step"] + cloud["offset"]
            ends = limb_ends(run.body, record.poses)[:, tips, 1]
            assert np.abs(places - ends).max() <= 0.51 * cloud["step"]
            parents = [-1] * len(record.poses) if before is None else before.parents[0].tolist()
            assert layer["parents"] == parents
            weights = np.frombuffer(base64.b64decode(layer["weights"]), dtype=np.uint8)
            assert weights[int(record.log_weights.argmax())] == 255
    with pytest.raises(RunError, match="cannot be in the page"):
        shared_page(run, 3, clouds=(99,))
