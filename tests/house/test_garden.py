"""The garden: nothing of the product may need the papers, the benchmarks or the making of footage."""

import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
GARDEN = {"reproduction", "benchmarks", "synthesis"}


def test_the_contract_of_the_garden_names_every_other_room() -> None:
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    (garden,) = (one for one in contracts if one["name"] == "garden")
    studio = ROOT / "studio"
    rooms = {path.parent.name for path in studio.glob("*/__init__.py")}
    files = {path.stem for path in studio.glob("*.py")} - {"__init__"}
    assert set(garden["source_modules"]) == {f"studio.{name}" for name in (rooms | files) - GARDEN}
    assert set(garden["forbidden_modules"]) == {f"studio.{name}" for name in GARDEN}
