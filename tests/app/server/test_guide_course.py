"""The guide's course: its runs are made once, its pages lead to what is there."""

import re
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import pytest
from web_doubles import Studio

import studio
from studio.app.server.guide_routes import COURSE, TEXTS
from studio.operations import course as room
from studio.operations.course import BEGINNING, BEGINNING_RUN, FRAMES, RUNS, SAMPLE, CourseRun, make_course
from studio.results.inspection.views import VIEWS
from studio.search.settings import knob_table
from studio.sessions.workspace import Workspace

ROOT = Path(__file__).resolve().parents[3]
GUIDE = ROOT / "web_assets" / "guide"
STATES = set(re.findall(r'\{ name: "(\w+)"', (ROOT / "web_assets" / "js" / "address.js").read_text()))
PANELS = set(
    re.findall(r'^  \["(\w+)", "', (ROOT / "web_assets" / "js" / "studio" / "panels.js").read_text(), re.M)
)
SMALL = (
    CourseRun("course-a", "one layer", knobs={"layers": 1, "particles": 10}),
    CourseRun("course-b", "two layers", knobs={"layers": 2, "particles": 10}),
)


def text_of(page: str) -> str:
    return (GUIDE / TEXTS[page][0]).read_text(encoding="utf-8")


def links_of(page: str) -> list[str]:
    return re.findall(r"(?<!!)\[[^\]]+\]\(([^)]+)\)", text_of(page))


@pytest.mark.parametrize("page", COURSE)
def test_every_link_of_a_page_names_a_state_that_there_is(page: str) -> None:
    names = {run.name for run in RUNS}
    for link in links_of(page):
        address = urlsplit(link)
        state = {key: found[0] for key, found in parse_qs(address.query).items()}
        if address.path != "/":
            assert address.path.removeprefix("/guide/") in COURSE or address.path in (
                "/guide",
                "/comparisons",
                "/behaviours",
            )
            continue
        if set(state) == {"course"}:
            assert state["course"] in COURSE
            continue
        assert set(state) - {"plays", "knob"} <= STATES, link
        assert state.get("plays", "layers") == "layers"
        assert state.get("knob", "survival") in {knob.name for knob in knob_table()}
        begins = (state["session"], state["run"]) == (BEGINNING, BEGINNING_RUN)
        assert begins or (state["session"] == SAMPLE and state["run"] in names)
        assert int(state["frame"]) < (12 if begins else FRAMES)
        assert state["panel"] in PANELS
        assert state.get("view", "variance") in VIEWS
        for other in state.get("compared", "").split(","):
            assert not other or other.removeprefix(f"{SAMPLE}/") in names


def test_the_pages_speak_of_every_run_and_their_pictures_are_there() -> None:
    spoken = " ".join(text_of(page) for page in COURSE)
    for run in RUNS:
        assert f"run={run.name}" in spoken
        assert f"`{run.name}`" in text_of("course")
    pictures = re.findall(r"!\[([^\]]+)\]\(/assets/guide/([\w.-]+)\)", spoken)
    assert len(pictures) >= 5
    taken = (ROOT / "tests" / "guide_pictures.py").read_text()
    for words, file in pictures:
        assert words
        assert (GUIDE / file).stat().st_size < 250_000
        assert f'"{file}"' in taken


@pytest.mark.slow
def test_runs_are_made_once(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(room, "RUNS", SMALL)
    monkeypatch.setattr(room, "FRAMES", 2)
    workspace, told = Workspace(tmp_path / "workspace"), list[tuple[str, int, int]]()

    def report(*step: object) -> None:
        told.append(step)  # pyright: ignore[reportArgumentType]

    first = make_course(workspace, report, processes=1)
    assert [run.name for run in first.runs] == ["course-a", "course-b"]
    assert {run.summary().status for run in first.runs} == {"finished"}
    assert told == [("tracking", 0, 2), ("one layer", 1, 2), ("two layers", 2, 2)]
    record = first.runs[1].record
    assert (record.settings["layers"], record.settings["refine_frames"], record.last) == (2, False, 2)
    stamps = [(run.folder / "run.json").stat().st_mtime_ns for run in first.runs]
    told.clear()
    again = make_course(workspace, report, processes=1)
    assert [(run.folder / "run.json").stat().st_mtime_ns for run in again.runs] == stamps
    assert told == [("tracking", 0, 0)]


def test_the_page_asks_whether_they_are_there(studio: Studio, monkeypatch: pytest.MonkeyPatch) -> None:
    found = studio.get("/api/course")
    assert [run["name"] for run in found["runs"]] == [BEGINNING_RUN, *(run.name for run in RUNS)]
    assert not any(run["there"] for run in found["runs"])
    assert found["job"] is None
    studio.delete("/api/course", code=404)


@pytest.mark.slow
def test_what_the_course_says_of_its_runs_is_so() -> None:
    made = studio.course()
    rows = re.findall(r"\| `(course-[\w-]+)` \| [^|]+ \| (\d+) mm \| ([^|]+) \|", text_of("course"))
    assert [name for name, _, _ in rows] == [run.name for run in made.runs]
    for run, (_, millimetres, lost) in zip(made.runs, rows, strict=True):
        found = studio.evaluate(run, track="raw")
        assert found.mean_mm == pytest.approx(float(millimetres), rel=0.2)
        if lost.startswith("from frame"):
            assert found.lost_frame_numbers == tuple(range(int(lost.split()[2]), FRAMES))
        else:
            assert lost.strip() == "never"
            assert found.lost_frames == 0
    one_layer, annealed, _, behaviour = (millimetres for _, millimetres, _ in rows)
    assert f"{annealed} mm against {one_layer} mm" in text_of("annealing")
    assert f"{behaviour} mm off instead of {one_layer}" in text_of("partitions")
