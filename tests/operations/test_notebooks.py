"""The example notebooks run from top to bottom, and are kept without what they printed."""

import json
from pathlib import Path

import pytest

import studio

NOTEBOOKS = sorted((Path(__file__).resolve().parents[2] / "web_assets" / "notebooks").glob("*.ipynb"))


def run_notebook(path: Path) -> dict[str, object]:
    """What the names of a notebook are after its last cell."""
    names: dict[str, object] = {}
    for number, cell in enumerate(json.loads(path.read_text(encoding="utf-8"))["cells"], 1):
        if cell["cell_type"] == "code":
            exec(compile("".join(cell["source"]), f"{path.name}, cell {number}", "exec"), names)
    return names


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder to work in, with a workspace."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("STUDIO_WORKSPACE", str(tmp_path / "workspace"))
    return tmp_path


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_kept_without_results(path: Path) -> None:
    notebook = json.loads(path.read_text(encoding="utf-8"))
    assert notebook["nbformat"] == 4
    assert len(notebook["cells"]) > 5
    for cell in notebook["cells"]:
        assert cell["cell_type"] == "markdown" or (cell["outputs"], cell["execution_count"]) == ([], None)


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.usefixtures("here")
def test_the_layers_of_a_search() -> None:
    names = run_notebook(next(path for path in NOTEBOOKS if path.stem == "layers_of_a_search"))
    narrowed, left = names["narrowed"], names["left"]
    assert narrowed.max() > 3.0  # pyright: ignore[reportAttributeAccessIssue]
    assert left[0] == 60  # pyright: ignore[reportIndexIssue]
    assert 1 <= left[-1] < 30  # pyright: ignore[reportIndexIssue]


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.usefixtures("here")
def test_a_posterior_of_a_pose() -> None:
    names = run_notebook(next(path for path in NOTEBOOKS if path.stem == "a_posterior_of_a_pose"))
    evidence = names["evidence"]
    assert evidence["own"] > evidence["a tenth larger"]  # pyright: ignore[reportIndexIssue]
    assert "chain-2" in [run.name for run in studio.list_runs("walk-small")]


@pytest.mark.slow
@pytest.mark.timeout(900)
@pytest.mark.usefixtures("here")
def test_a_race_of_ones_own() -> None:
    names = run_notebook(next(path for path in NOTEBOOKS if path.stem == "a_race_of_ones_own"))
    assert "my-search" in names["raced"].document["findings"]["words"]  # pyright: ignore[reportAttributeAccessIssue]
    assert names["heights"][-1] > names["heights"][0]  # pyright: ignore[reportIndexIssue]
