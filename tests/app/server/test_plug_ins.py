"""A tracker, a likelihood and formats from outside the package: the files of the guide's page, used in every way."""

import json
import os
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from guide_package import FILES, ROOT, install_guide_package, lay_out
from test_real_worker import Page
from toy_session import make_session, true_poses
from web_doubles import TOKEN, cookie_header, let_in, serving
from websockets.sync.client import connect

from studio.app.scene.window_scenes import WindowScenes
from studio.app.server.access import Tokens
from studio.app.server.app import build_app
from studio.app.server.guide_routes import rendered
from studio.body.catalogue import list_bodies, load_body
from studio.footage.capture.calibration_files import find_calibrations, read_calibration
from studio.footage.capture.calibration_writers import CALIBRATION_FORMATS
from studio.foundations.errors import SettingsError
from studio.foundations.registry import PlugInError, Registry, UnknownMemberError
from studio.operations.jobs.control import StudioControl
from studio.results.comparison.kept_trials import measured_by
from studio.results.export.formats import FORMATS
from studio.runs.new_run import prepare_run
from studio.search.likelihood.catalogue import WEIGHTINGS
from studio.search.settings import default_settings
from studio.search.trackers.catalogue import TRACKERS
from studio.sessions.workspace import Workspace

REGISTRIES: tuple[Registry, ...] = (TRACKERS, WEIGHTINGS, FORMATS, CALIBRATION_FORMATS)
CHOSEN = ("--tracker", "random", "--weighting", "inside", "--set", "particles=300", "--set", "reach=0.8")


def forget() -> None:
    """Let every registry look for packages anew."""
    for registry in REGISTRIES:
        for cached in ("_added", "packages"):
            registry.__dict__.pop(cached, None)
    rendered.cache_clear()


@pytest.fixture
def site(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """A folder of installed packages, empty."""
    folder = tmp_path / "site"
    folder.mkdir()
    monkeypatch.syspath_prepend(str(folder))
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join((str(folder), str(ROOT))))
    forget()
    yield folder
    for name in [name for name in sys.modules if name.partition(".")[0] in ("my_capture", "broken_capture")]:
        del sys.modules[name]
    monkeypatch.undo()
    forget()


@pytest.fixture
def installed(site: Path) -> Path:
    """The guide's package, installed."""
    install_guide_package(site)
    return site


@pytest.fixture
def toy_root(tmp_path: Path) -> Path:
    """A workspace with the planar arm."""
    make_session(tmp_path / "toys" / "toy")
    return tmp_path / "toys"


def studio(root: Path, *words: str) -> subprocess.CompletedProcess[str]:
    """The command line in a process of its own."""
    return subprocess.run(
        [sys.executable, "-c", "from studio.cli.main import main; main()", *words],
        capture_output=True,
        text=True,
        env=os.environ | {"STUDIO_WORKSPACE": str(root)},
        check=False,
    )


@pytest.mark.slow
def test_the_command_line_tracks_and_exports_with_them(
    installed: Path, toy_root: Path, tmp_path: Path
) -> None:
    start = tmp_path / "start.csv"
    start.write_text("x1,x2,x3,x4\n" + ",".join(map(str, true_poses()[0])) + "\n")
    words = ("--frames", "0:4", "--start-pose", str(start), "--name", "own", "--keep-shape", "--json")
    done = studio(toy_root, "track", "toy", *CHOSEN, *words)
    assert done.returncode == 0, done.stderr
    response = json.loads(done.stdout)
    assert (response["tracker"], response["weighting"], response["frames"]) == ("random", "inside", 4)
    assert response["evaluations_per_frame"] == 300
    place = tmp_path / "own.json"
    exported = studio(toy_root, "export", "toy", "own", "--to", str(place), "--track", "raw", "--json")
    assert exported.returncode == 0, exported.stderr
    assert "read back exactly" in json.loads(exported.stdout)["checked"]
    poses = np.array(json.loads(place.read_text())["poses"])
    assert np.abs(poses - true_poses()[:4]).max() < 0.26
    again = studio(toy_root, "track", "toy", *CHOSEN, *(word.replace("own", "again") for word in words))
    assert again.returncode == 0, again.stderr
    runs = {name: Workspace(toy_root).session("toy").run(name) for name in ("own", "again")}
    with runs["own"].results() as one, runs["again"].results() as other:
        np.testing.assert_array_equal(one.poses()[1], other.poses()[1])
    assert "random" in studio(toy_root, "compare", "--help").stdout


@pytest.fixture
def page(installed: Path, toy_root: Path, tmp_path: Path) -> Iterator[Page]:
    """A page before the whole studio."""
    workspace = Workspace(toy_root)
    control = StudioControl(workspace)
    app = build_app(
        workspace, control, WindowScenes(workspace, control), Tokens(TOKEN), log_path=tmp_path / "log"
    )
    with serving(app) as base, let_in(base, TOKEN) as client:
        headers = {"cookie": cookie_header(client)}
        with connect(
            base.replace("http", "ws") + "/api/events",
            origin=base,  # pyright: ignore[reportArgumentType]
            additional_headers=headers,
        ) as socket:
            yield Page(client, socket, control)


@pytest.mark.slow
def test_the_page_is_offered_them_and_tracks_with_them(page: Page) -> None:
    get = page.client.get
    choices = get("/api/choices").json()
    assert {"name": "random", "label": "Random search", "needs_behaviour": False} in choices["trackers"]
    assert {"name": "inside", "label": "Inside the silhouettes"} in choices["weightings"]
    assert choices["problems"] == []
    assert measured_by().endswith(", my-capture 1.0"), "what another version measured is measured again"
    knobs = get("/api/knobs", params={"tracker": "random", "weighting": "inside"}).json()["values"]
    assert {"reach": 1.0, "points_a_limb": 12}.items() <= knobs.items()
    candidates = {entry["name"]: entry for entry in get("/api/comparisons/choices").json()["candidates"]}
    assert candidates["random"]["sized_by"] == ["particles"]
    assert get("/api/evaluations", params={"tracker": "random", "evaluations": 500}).json() == {
        "particles": 500
    }
    assert "json" in [form["name"] for form in get("/api/exports/choices").json()["formats"]]
    guide = get("/guide").text
    assert "Tracker: random" in guide
    assert "points a limb" in guide or "points_a_limb" in guide

    made = page.post(
        "/api/sessions/toy/runs",
        {
            "name": "own",
            "tracker": "random",
            "weighting": "inside",
            "settings": {"particles": 50, "start_repeats": 1},
            "last": 2,
            "fit_shape": False,
        },
    )
    assert made["tracker"] == "random"
    shown = page.client.post("/api/scene/show", json={"session": "toy", "run": "own"})
    assert shown.status_code == 204
    page.post("/api/sessions/toy/runs/own/start")
    page.until("state", state="finished")
    summary = get("/api/sessions/toy/runs/own/frames").json()
    assert [entry["evaluations"] for entry in summary["frames"]] == [50, 50]
    assert summary["describe"] == "random 50 · inside"
    assert summary["score"] == ["Best weight", "log w"]
    of_run, of_frame = "/api/sessions/toy/runs/own/views/", "/api/sessions/toy/runs/own/frames/1/views/"
    for view in get("/api/views").json()["views"]:
        chosen = {"camera": "cam1", "parameter": "x1"}
        for place in (of_run, of_frame):
            answer = get(place + view["name"], params=chosen)
            assert answer.status_code == 200 or "shows whole runs" in answer.text, answer.text


def test_a_body_and_a_calibration_format(installed: Path, tmp_path: Path) -> None:
    folder = tmp_path / "bodies"
    folder.mkdir()
    (folder / "elbow.toml").write_text(FILES["bodies/elbow.toml"], encoding="utf-8")
    assert "elbow" in list_bodies((folder,))
    assert [limb.name for limb in load_body("elbow", (folder,)).drawn] == ["upper arm", "lower arm"]

    cameras = make_session(tmp_path / "toy").cameras()
    place = tmp_path / "rigs" / "lab.rig"
    place.parent.mkdir()
    CALIBRATION_FORMATS["rig"].write(cameras, place)
    assert find_calibrations(place.parent) == (place,)
    (read,) = read_calibration(place).cameras
    np.testing.assert_array_equal(read.matrix, cameras[0].matrix)
    np.testing.assert_array_equal(read.translation, cameras[0].translation)


BROKEN = {
    "broken_capture/__init__.py": "",
    "broken_capture/good.py": "SOMETHING = 3\n",
    "broken_capture/bad.py": "import no_such_module_anywhere\n",
}


def test_a_broken_package_is_named_and_hinders_nothing(site: Path, toy_root: Path) -> None:
    modules = {"missing": "bad:TRACKER", "number": "good:SOMETHING", "annealed": "good:SOMETHING"}
    points = {name: f"broken_capture.{place}" for name, place in modules.items()}
    lay_out(site, BROKEN, "broken-capture", {"studio.trackers": points})
    forget()
    assert list(TRACKERS) == ["annealed", "behaviour", "condensation", "swarm", "tempered"]
    assert TRACKERS["annealed"].label == "Annealed particle filter"
    with pytest.raises(
        PlugInError, match=r"'broken-capture' adds a tracker 'missing'.*no_such_module_anywhere"
    ):
        default_settings("missing")
    with pytest.raises(PlugInError, match=r"'number'.*it is no Tracker but 3"):
        default_settings("number")
    assert len(TRACKERS.problems) == 3
    assert "of that name already" in TRACKERS.problems[0]
    refused = studio(toy_root, "track", "toy", "--tracker", "missing")
    assert refused.returncode == 2
    assert "broken-capture" in refused.stderr
    assert "Traceback" not in refused.stderr


def test_a_knob_that_means_two_things_is_refused(installed: Path) -> None:
    text = FILES["my_capture/inside.py"].replace("points_a_limb", "particles")
    (installed / "my_capture" / "inside.py").write_text(text, encoding="utf-8")
    with pytest.raises(SettingsError, match="'particles' means two things with tracker 'random'"):
        default_settings("random", "inside")


@pytest.mark.slow
def test_a_run_of_a_tracker_that_is_not_installed_is_named(installed: Path, toy_root: Path) -> None:
    session = Workspace(toy_root).session("toy")
    prepare_run(session, tracker="random", weighting="inside", last=2, name="own", fit_shape=False)
    for about in installed.glob("*.dist-info"):
        (about / "entry_points.txt").write_text("", encoding="utf-8")
    forget()
    with pytest.raises(UnknownMemberError, match=r"no tracker 'random'.*a package of yours"):
        default_settings("random")
    refused = studio(toy_root, "track", "toy", "--resume", "own")
    assert refused.returncode == 2
    assert "There is no tracker 'random'" in refused.stderr
    listed = studio(toy_root, "runs", "toy", "--json")
    assert listed.returncode == 0, listed.stderr
    assert json.loads(listed.stdout)["runs"][0]["tracker"] == "random"


def test_the_pages_ask_the_api_and_know_no_tracker_or_likelihood() -> None:
    """But for the line-up that a new comparison begins with, and the prediction by behaviour."""
    names = {*TRACKERS, *WEIGHTINGS} - {"behaviour", "template"}
    known = re.compile(rf"""["'`]({"|".join(sorted(names))})["'`]""")
    found = {
        f"{path.name}: {line.strip()}"
        for path in (ROOT / "web_assets" / "js").glob("*.js")
        for line in path.read_text(encoding="utf-8").splitlines()
        if known.search(line)
    }
    assert [line.partition(" =")[0] for line in found] == ["comparison_form.js: const USUAL"]
