"""The application before the real tracking process and scene: from the page's requests to stored frames."""

import json
from collections.abc import Iterator
from pathlib import Path

import httpx
import psutil
import pytest
from web_doubles import TOKEN, cookie_header, let_in, serving
from websockets.sync.client import ClientConnection, connect

from studio.app.scene.window_scenes import WindowScenes
from studio.app.server.access import Tokens
from studio.app.server.app import build_app
from studio.operations.jobs.control import StudioControl
from studio.sessions.workspace import Workspace

SMALL = {"layers": 3, "particles": 12, "start_repeats": 1}
RUN = "/api/sessions/take1/runs/small"


class Page:
    """What a page has: a client and the event socket."""

    def __init__(self, client: httpx.Client, socket: ClientConnection, control: StudioControl) -> None:
        self.client, self.socket, self.control = client, socket, control

    def get(self, path: str) -> dict:
        answer = self.client.get(path)
        assert answer.is_success, answer.text
        return answer.json()

    def post(self, path: str, body: object = None) -> dict:
        answer = self.client.post(path, json=body)
        assert answer.is_success, answer.text
        return answer.json()

    def until(self, kind: str, **wanted: object) -> dict:
        """The next event of a kind with these entries."""
        while True:
            event = json.loads(self.socket.recv(timeout=120))
            assert not (event["type"] == "acknowledged" and not event["ok"]), event
            if event["type"] == kind and all(event[name] == value for name, value in wanted.items()):
                return event


@pytest.fixture
def page(workspace: Workspace, tmp_path: Path) -> Iterator[Page]:
    """A page in front of the whole studio."""
    control = StudioControl(workspace)
    app = build_app(
        workspace, control, WindowScenes(workspace, control), Tokens(TOKEN), log_path=tmp_path / "log"
    )
    with serving(app) as base, let_in(base, TOKEN) as client:
        socket = connect(
            base.replace("http", "ws") + "/api/events",
            origin=base,  # pyright: ignore[reportArgumentType]
            additional_headers={"cookie": cookie_header(client)},
        )
        with socket:
            yield Page(client, socket, control)
    assert control.process_identifier is None


def test_from_a_new_run_to_its_end_and_into_the_trash(page: Page) -> None:
    client = page.client
    made = page.post("/api/sessions/take1/runs", {"name": "small", "settings": SMALL, "last": 3})
    assert made["status"] == "new"
    assert client.post("/api/scene/show", json={"session": "take1", "run": "small"}).status_code == 204

    # A layer, a frame, then on.
    page.post(f"{RUN}/step-layer")
    assert page.until("layer")["layer"] == 0
    page.until("state", state="paused", frame=0, layer=1)
    assert [layer["layer"] for layer in page.get(f"{RUN}/frames/0")["layers"]] == [0]
    assert page.get(f"{RUN}/frames")["partial"] == 0
    page.post(f"{RUN}/step-frame")
    stored = page.until("frame", frame=0, reannealed=False)
    page.until("state", state="paused", frame=1)

    # A slider while paused anneals the frame again and leaves the stored answer alone.
    changed = client.patch(f"{RUN}/settings", params={"frame": 0}, json={"survival": 0.77})
    assert changed.status_code == 200
    answer = page.until("layer", frame=0, reannealed=True, layer=2)
    assert answer["alpha_wanted"] == 0.77
    assert answer["waited_milliseconds"] > 0.0
    assert page.until("frame", reannealed=True)["pose"] != stored["pose"]
    assert page.get(f"{RUN}/frames/0")["pose"] == stored["pose"]

    page.post(f"{RUN}/start")
    page.until("settings", version=2)
    page.until("state", state="finished")
    assert [entry["frame"] for entry in page.get(f"{RUN}/frames")["frames"]] == [0, 1, 2]
    assert any("Finished" in line["text"] for line in page.get(f"{RUN}/log")["lines"])

    # It is still open in the tracking process, and can be renamed and deleted all the same.
    renamed = client.patch(RUN, json={"name": "done"})
    assert renamed.status_code == 200, renamed.text
    assert client.delete("/api/sessions/take1/runs/done").status_code == 200
    assert client.delete("/api/sessions/take1").status_code == 200


@pytest.mark.slow
def test_when_the_process_is_killed_the_page_is_reported_and_start_resumes(page: Page) -> None:
    page.post("/api/sessions/take1/runs", {"name": "small", "settings": SMALL | {"layers": 40}})
    # Four seconds a frame: it is killed in mid-run however long a busy machine keeps this thread waiting.
    page.post("/api/worker/pace", {"seconds_a_layer": 0.1})
    page.post(f"{RUN}/start")
    page.until("layer", layer=1)
    identifier = page.control.process_identifier
    assert identifier is not None
    psutil.Process(identifier).kill()
    lost = page.until("state", state="lost")
    assert lost["message"]
    assert lost["hint"]
    assert page.get("/api/worker")["state"] == "lost"
    page.get("/api/sessions")
    page.post(f"{RUN}/start")
    page.post("/api/worker/pace", {"seconds_a_layer": 0})
    page.until("state", state="finished")
    assert len(page.get(f"{RUN}/frames")["frames"]) == 4


@pytest.mark.slow
def test_a_refusal_of_the_process_reaches_the_page_in_words(page: Page) -> None:
    page.post("/api/sessions/take1/runs", {"name": "small", "settings": SMALL})
    wrong = page.client.patch(f"{RUN}/settings", json={"start_repeats": 3})
    assert wrong.status_code == 422
    assert "new run" in wrong.json()["hint"].lower()
