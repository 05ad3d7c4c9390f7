"""The page, its assets, the guide, preferences, and what the scene is told to show."""

import html
import json
import re
from dataclasses import replace
from urllib.parse import urljoin

import pytest
from playwright.sync_api import Browser
from web_doubles import TOKEN, Studio

from studio.app.scene.model import Selection
from studio.app.server import guide_routes
from studio.app.server.guide_routes import COURSE, anchor_of
from studio.app.server.pages import PLACES
from studio.evidence.settings import EvidenceSettings
from studio.foundations.knobs import knobs_of
from studio.foundations.package import assets_folder
from studio.garden.reproduction.catalogue import EXPERIMENTS
from studio.results.comparison.findings import VERDICTS
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import RecordingSettings
from studio.search.trackers.catalogue import TRACKERS
from studio.search.trackers.paper_presets import PAPERS
from studio.sessions.stored_run import StoredRun

GUIDE_PAGES = (
    "interfaces",
    "python",
    "verbs",
    "commands",
    "adding",
    "animal",
    "formats",
    "live-out",
    "glossary",
    "figures",
    "reproduction",
    "by-hand",
)


def test_the_page_and_all_that_it_names_are_there(studio: Studio) -> None:
    page = studio.client.get("/")
    assert page.headers["content-type"].startswith("text/html")
    assert TOKEN not in page.text
    named = re.findall(r'(?:href|src)="(/assets/[^"]+)"', page.text)
    assert named
    for address in named:
        studio.get(address)


@pytest.mark.parametrize(
    ("address", "title"),
    [
        ("/", "Capture studio"),
        ("/way", "Guided set-up · Capture studio"),
        ("/gallery", "Gallery · Capture studio"),
        ("/recording", "Live cameras · Capture studio"),
        ("/bodies", "Bodies · Capture studio"),
        ("/comparisons", "Comparisons · Capture studio"),
        ("/behaviours", "Behaviours · Capture studio"),
        ("/reports", "Reports · Capture studio"),
        ("/arena", "Arena · Capture studio"),
        ("/rig", "Where cameras should stand · Capture studio"),
        ("/guide", "Guide · Capture studio"),
    ],
)
def test_every_page_is_put_together_whole(studio: Studio, address: str, title: str) -> None:
    text = studio.client.get(address).text
    assert f"<title>{title}</title>" in text
    assert "{{" not in text.partition("<main")[0]
    for once in ('charset="utf-8"', 'href="/assets/page.css"', 'id="theme"', 'aria-label="Pages"'):
        assert text.count(once) == 1, once
    # Work in the background is found again on every page: the two that are no documents show it themselves.
    shows_work = {"/": "js/main.js", "/way": "js/setup.js"}.get(address, "js/header_of_documents.js")
    assert (text.count('id="work-list"'), text.count(f'src="/assets/{shows_work}"')) == (1, 1)
    places = re.findall(
        r'<a href="([^"]+)"( aria-current="page")?',
        text.partition('class="places"')[2].partition("</nav>")[0],
    )
    assert [to for to, _ in places] == list(PLACES)
    assert [to for to, mark in places if mark] == ([address] if address in PLACES else [])
    for asset in re.findall(r'(?:href|src)="(/assets/[^"]+)"', text):
        studio.get(asset)


@pytest.mark.browser
def test_four_upright_views_are_seen_without_scrolling(browser: Browser) -> None:
    folder = assets_folder()
    styles = "".join((folder / name).read_text() for name in ("tokens.css", "page.css", "setup.css"))
    upright = "data:image/svg+xml,<svg xmlns='http://www.w3.org/2000/svg' width='1080' height='1920'/>"
    figure = f'<figure class="picture"><img src="{upright}"><figcaption><b>cam</b></figcaption></figure>'
    body = (folder / "setup.html").read_text().partition("<body")[2].partition(">")[2]
    page = browser.new_page(viewport={"width": 1280, "height": 800})
    page.set_content(
        f'<html data-theme="dark"><style>{styles}</style><body class="setup">{body}</body></html>'
    )
    page.evaluate(
        "figures => { document.getElementById('aside').innerHTML = `<div class=pictures>${figures}</div>`; }",
        4 * figure,
    )
    page.wait_for_function("[...document.images].every((image) => image.complete)")
    boxes = [page.locator("#aside img").nth(at).bounding_box() for at in range(4)]
    page.close()
    for box in boxes:
        assert box["height"] > 140
        assert box["y"] + box["height"] <= 800


def test_modules_have_the_type_that_browsers_want_and_are_requested_anew(studio: Studio) -> None:
    module = studio.client.get("/assets/js/main.js")
    assert module.headers["content-type"].startswith("text/javascript")
    assert module.headers["cache-control"] == "no-cache"
    studio.get("/assets/js/main.js", headers={"if-none-match": module.headers["etag"]}, code=304)


def test_the_guide_carries_what_experiments_found_before_and_after(studio: Studio) -> None:
    text = studio.client.get("/guide/reproduction").text
    assert "{{" not in text
    folder = assets_folder() / "guide" / "reproduction"
    before = json.loads((folder / "before.json").read_text(encoding="utf-8"))["rows"]
    found = {path.stem: json.loads(path.read_text(encoding="utf-8")) for path in folder.glob("*.json")}
    del found["before"]
    rows = re.findall(
        r"<tr><td>.*?<code>([\w-]+)</code>.*?</td><td>(.*?)</td><td>(.*?)</td><td>(.*?)</td>", text
    )
    known = dict.fromkeys((*before, *sorted(found)))
    assert [name for name, *_ in rows] == sorted(known, key=lambda name: name not in found)
    assert {name for name, *_ in rows} <= set(EXPERIMENTS)
    for name, old, new, why in rows:
        if name in before:
            assert f"<summary>{before[name]['verdict']}" in old
        if name not in found:
            assert "before commits were kept" in new
            continue
        document = found[name]
        assert document["verdict"] in VERDICTS
        assert f"<summary>{document['verdict']}" in new
        assert all(commit in new for commit in document["commits"])
        # A row that changed says why.
        firm = "" if document["firm"] else " (not firm)"
        assert why or name not in before or before[name]["verdict"] == document["verdict"] + firm, name
        assert studio.get(f"/assets/guide/reproduction/{name}.json")["name"] == name


def test_the_guide_says_what_is_printed_what_is_run_and_why(monkeypatch: pytest.MonkeyPatch) -> None:
    """A row an entry of a preset, with its knobs' own values; the third cell is empty where nothing differs."""
    tables = guide_routes.printed_and_run().split("<h3 ")[1:]
    assert len(tables) == len(PAPERS)
    for preset, table in zip(PAPERS, tables, strict=True):
        rows = re.findall(r"<tr><td>(.*?)</td><td>(.*?)</td><td>(.*?)</td></tr>", table)
        assert [(html.unescape(printed), html.unescape(why)) for printed, _, why in rows] == [
            (entry.printed, entry.why) for entry in (*preset.printed, *preset.learning)
        ]
        assert {bool(why) for *_, why in rows} == {True, False}
        for (_, run, _), entry in zip(rows, (*preset.printed, *preset.learning), strict=True):
            for value in entry.sets.values():
                if isinstance(value, float | int) and not isinstance(value, bool):
                    assert re.search(rf"(?<![\d.]){re.escape(f'{value:g}')}(?![\d.])", run), (entry, run)
    # Another value is another table.
    first, *others = PAPERS
    layers = next(entry for entry in first.printed if "layers" in entry.sets)
    other = replace(layers, sets={**layers.sets, "layers": 7})
    printed = tuple(other if entry is layers else entry for entry in first.printed)
    monkeypatch.setattr(guide_routes, "PAPERS", (replace(first, printed=printed), *others))
    assert guide_routes.printed_and_run().split("<h3 ")[1] != tables[0]


def test_the_guide_has_every_knob_with_its_range(studio: Studio) -> None:
    text = studio.client.get("/guide").text
    assert "{{knobs}}" not in text
    types = [entry.settings_type for entry in (*TRACKERS.values(), *WEIGHTINGS.values())]
    for settings_type in (*types, EvidenceSettings, RecordingSettings):
        for knob in knobs_of(settings_type):
            assert f"<code>{knob.name}</code>" in text, knob.name
            assert knob.takes_effect in text
    assert "a number from 0.02 to 0.98" in text
    for anchor in re.findall(r'<a href="#([^"]+)"', text):
        assert f'id="{anchor}"' in text


def test_every_page_that_the_guide_refers_to_is_there(studio: Studio) -> None:
    seen: dict[str, str] = {}
    left = ["/guide"]
    while left:
        place = left.pop()
        answer = studio.client.get(place)
        assert answer.status_code == 200, place
        seen[place] = answer.text
        left += set(re.findall(r'href="(/guide(?:/[a-z-]+)?)"', answer.text)) - set(seen) - set(left)
    assert set(seen) == {
        "/guide",
        *(f"/guide/{name}" for name in GUIDE_PAGES),
        *(f"/guide/{name}" for name in COURSE),
    }
    studio.get("/guide/nothing", code=404)


def test_every_picture_of_the_guide_is_there_at_the_address_that_its_page_names(studio: Studio) -> None:
    pictures = [
        (place, urljoin(place, source))
        for place in ("/guide", *(f"/guide/{name}" for name in (*GUIDE_PAGES, *COURSE)))
        for source in re.findall(r'<img src="([^"]+)"', studio.client.get(place).text)
    ]
    assert "/guide/animal" in dict(pictures)
    for place, address in pictures:
        answer = studio.client.get(address)
        assert answer.status_code == 200, (place, address)
        assert answer.headers["content-type"].startswith("image/"), (place, address)


def test_the_guide_links_to_the_page_of_python_examples(studio: Studio) -> None:
    assert 'href="/guide/python"' in studio.client.get("/guide").text
    answer = studio.client.get("/guide/python")
    assert answer.status_code == 200
    assert "<title>Python · Capture studio</title>" in answer.text
    assert 'href="/guide"' in answer.text
    assert "studio.track(session" in answer.text
    assert "{" + "{" not in answer.text
    for anchor in re.findall(r'<a href="#([^"]+)"', answer.text):
        assert f'id="{anchor}"' in answer.text


def test_anchors_are_plain_words() -> None:
    assert anchor_of("Survival & β: α wanted") == "survival-β-α-wanted"


def test_preferences_are_remembered(studio: Studio) -> None:
    client = studio.client
    assert client.get("/api/preferences").json() == {}
    assert client.patch("/api/preferences", json={"theme": "dark", "speed": 2}).json() == {
        "theme": "dark",
        "speed": 2,
    }
    assert client.patch("/api/preferences", json={"speed": None, "folded": ["log"]}).status_code == 200
    assert client.get("/api/preferences").json() == {"theme": "dark", "folded": ["log"]}
    big = client.patch("/api/preferences", json={"x": "y" * 20_000})
    assert big.status_code == 422
    assert client.get("/api/preferences").json() == {"theme": "dark", "folded": ["log"]}
    (studio.workspace.root / ".studio" / "preferences.json").write_text("[broken")
    assert client.get("/api/preferences").json() == {}


@pytest.mark.parametrize(
    ("wish", "calls"),
    [
        ({"session": "take1", "run": "first", "frame": 1, "layer": 2}, [("run", "take1", "first", 1, 2)]),
        ({"session": "take1"}, [("run", "take1", "", None, None, "goes on")]),
        ({"session": "take1", "run": None, "frame": None, "layer": None}, [("run", "take1", "", None, None)]),
        ({"frame": 3}, [("frame", 3)]),
        ({"layer": None}, [("layer", None)]),
        ({"look_through": ""}, [("look_through", None)]),
        ({"look_through": "cam1"}, [("look_through", "cam1")]),
        ({"dark": False}, [("options", {"dark": False})]),
        ({"options": {"overlays": ["mask"]}}, [("options", {"overlays": ("mask",)})]),
        ({"playing": True}, [("play", True)]),
        ({"frame": 1, "follow": False}, [("frame", 1), ("follow", False)]),
        ({}, []),
    ],
)
@pytest.mark.parametrize("path", ["show", "view"])
def test_the_scene_is_reported_what_to_show(
    studio: Studio, tracked: StoredRun, path: str, wish: dict[str, object], calls: list[tuple]
) -> None:
    studio.post(f"/api/scene/{path}", wish, code=204)
    assert studio.stage.calls == calls


def test_layers_are_played_as_asked_and_what_is_left_out_stays(studio: Studio) -> None:
    path = "/api/scene/play-layers"
    assert studio.get(path) == {"playing": False, "rate": 3.0, "mode": "loop"}
    studio.post(path, {"playing": True, "rate": 10}, code=204)
    studio.post(path, {"mode": "pingpong"}, code=204)
    assert studio.stage.calls == [("play layers", True, 10.0, None), ("play layers", None, None, "pingpong")]
    for wrong in ({"rate": 0.5}, {"rate": 11}, {"mode": "random"}, {"speed": 1}):
        studio.post(path, wrong, code=422)


def test_the_scene_is_not_reported_of_what_does_not_exist(studio: Studio, tracked: StoredRun) -> None:
    for wish in ({"session": "none"}, {"session": "take1", "run": "none"}):
        studio.post("/api/scene/show", wish, code=404)
    for wish in ({"session": "../x"}, {"frame": -1}, {"layer": "x"}, {"unknown": 1}):
        studio.post("/api/scene/show", wish, code=422)
    assert studio.stage.calls == []
    assert Selection().session == ""


def test_the_api_describes_itself(studio: Studio) -> None:
    spec = studio.get("/api/openapi.json")
    assert spec["info"]["title"] == "Capture studio"
    for path, methods in spec["paths"].items():
        for method, operation in methods.items():
            assert operation.get("description"), (method, path)
            assert "ErrorAnswer" in str(operation["responses"]["422"]), (method, path)
            assert ("requestBody" in operation) == ("413" in operation["responses"]), (method, path)
