"""A body from its film, through the API: clicks are kept, and a job makes the body."""

import shutil
from dataclasses import asdict

from filmed_bodies import cameras_around, clicks_on, varied_poses, write_session
from waiting import until
from web_doubles import Studio

from studio.body.catalogue import load_body
from studio.body.dimensions import with_dimensions

PATH = "/api/sessions/arm/landmarks"
BODY = with_dimensions(load_body("planar_arm4"), {"link_2_length": 400.0})
JOINTS = ("Root", "Joint1", "Joint2", "Joint3", "Tip")


def test_clicks_are_kept_and_a_body_is_made_of_them(studio: Studio) -> None:
    poses, cameras = varied_poses(BODY, 3), cameras_around(2500.0, 900.0, 600.0, 2)
    folder = studio.workspace.root / "arm"
    write_session(folder, BODY, poses, cameras, masks=False)
    before = studio.get(PATH)
    assert (before["body"], before["clicks"]) == ("planar_arm4", [])
    assert {"Tip", "link_2", "link 2 tip"} < set(before["known"])
    assert "Nose" in studio.get(PATH, params={"like": "mouse"})["known"]
    empty = studio.post("/api/sessions/arm/body-from-film", {}, code=202)
    address = f"/api/bodies-from-film/{empty['identifier']}"
    until(lambda: studio.get(address)["state"] in ("done", "failed"))
    assert studio.get(address)["message"] == "No landmarks were clicked in session 'arm'."
    clicks = [asdict(one) for one in clicks_on(BODY, JOINTS, poses, cameras, 0.5)]
    kept = studio.put(PATH, {"clicks": clicks})
    assert len(kept) == len(clicks)
    assert studio.get(PATH)["clicks"] == kept
    wrong = studio.put(PATH, {"clicks": [{**clicks[0], "camera": "cam9"}]}, code=422)
    assert wrong["message"].startswith("There is no camera 'cam9'")
    assert studio.get(PATH)["clicks"] == kept
    begun = studio.post("/api/sessions/arm/body-from-film", {"save_as": "long-arm"}, code=202)
    address = f"/api/bodies-from-film/{begun['identifier']}"
    until(lambda: studio.get(address)["state"] in ("done", "failed"))
    done = studio.get(address)
    assert done["state"] == "done", done
    assert done["made"]["saved"] == "long-arm"
    sizes = {one["name"]: one["after"] for one in done["made"]["sizes"]}
    assert abs(sizes["link_2_length"] - 400.0) < 8.0
    assert studio.get("/api/bodies/long-arm")["title"].endswith("sized by its film")
    begun = studio.post("/api/sessions/arm/carry-clicks", {"name": "carried", "last": 2}, code=202)
    until(lambda: studio.get(f"/api/carried-clicks/{begun['identifier']}")["state"] in ("done", "failed"))
    assert studio.get(f"/api/carried-clicks/{begun['identifier']}")["run"] == "carried"
    assert [one["name"] for one in studio.get("/api/sessions/arm/runs")["runs"]] == ["carried"]
    studio.put(PATH, {"clicks": []})
    assert studio.get(PATH)["clicks"] == []
    shutil.rmtree(folder)
