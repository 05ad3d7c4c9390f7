"""The arena through the API: what there is, a race in the background, its page; no file is ever named from afar."""

import numpy as np
import pytest
import waiting
from web_doubles import Studio

RACE = {"problems": ["planar-arm"], "racers": ["random-search", "cma-es"], "evaluations": 200, "seeds": 2}


def raced(studio: Studio) -> dict:
    """The race's last state."""
    begun = studio.post("/api/arena/race", RACE, code=202)
    assert begun["state"] == "queued"
    [line] = studio.get("/api/jobs", params={"kind": "race"})["jobs"]
    assert line["page"] == "/arena"
    waiting.until(lambda: studio.get("/api/arena")["job"]["state"] in ("done", "failed"))
    return studio.get("/api/arena")["job"]


def test_a_race_is_begun_kept_and_downloaded(studio: Studio) -> None:
    before = studio.get("/api/arena")
    assert (before["race"], before["job"]) == (None, None)
    assert "planar-arm" in [one["name"] for one in before["problems"]]
    assert {"name": "cma-es", "label": "CMA-ES"} in before["racers"]
    assert studio.client.get("/api/arena/race.html").status_code == 404
    job = raced(studio)
    assert (job["state"], job["measured"], job["kept"]) == ("done", 4, 0), job
    race = studio.get("/api/arena")["race"]
    assert [one["name"] for one in race["drawn"]] == ["planar-arm"]
    [drawn] = race["drawn"]
    last = {name: of_it[str(drawn["counts"][-1])]["limbs"] for name, of_it in drawn["racers"].items()}
    assert list(last) == ["random-search", "cma-es"]
    assert np.shape(drawn["best_limbs"]) == (len(drawn["shapes"]), 2, 3)
    # Of a plane arm the better racer's tip is within a few mm of the best one's.
    tips = {
        name: np.linalg.norm(np.subtract(limbs, drawn["best_limbs"])[-1, 1]) for name, limbs in last.items()
    }
    assert min(tips.values()) < 10.0
    assert race["findings"]["seeds"] == 2
    page = studio.client.get("/api/arena/race.html")
    assert page.status_code == 200
    assert "attachment" in page.headers["content-disposition"]
    assert raced(studio)["kept"] == 4


@pytest.mark.parametrize(
    "change",
    [
        {"racers": ["/tmp/mine.py"]},
        {"racers": ["mine.py"]},
        {"file": "mine.npz"},
        {"out": "/tmp"},
        {"seeds": 0},
    ],
)
def test_files_and_impossible_numbers_are_refused(studio: Studio, change: dict) -> None:
    studio.post("/api/arena/race", RACE | change, code=422)
    assert studio.get("/api/arena")["job"] is None


def test_a_race_that_cannot_be_says_why(studio: Studio) -> None:
    studio.post("/api/arena/race", RACE | {"racers": ["gone"]}, code=202)
    waiting.until(lambda: studio.get("/api/arena")["job"]["state"] == "failed")
    assert "no racer 'gone'" in studio.get("/api/arena")["job"]["message"]
