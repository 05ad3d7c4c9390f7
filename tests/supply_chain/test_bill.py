"""The bill of materials is whole, says what each part's licence is, and is read by others."""

import dataclasses
import importlib.metadata
import json
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from studio.cli.self_check import OLDEST_PYTHON
from supply_chain import bill as bills
from supply_chain.bill import bill, components, doubts, licence_of, table

ROOT = Path(__file__).resolve().parents[2]


def test_every_part_is_there_once_with_hash_and_licence() -> None:
    found = components()
    assert doubts(found) == []
    assert len({one.reference for one in found}) == len(found) > 90
    names = {one.name for one in found}
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    for line in project["dependencies"]:
        name = bills._canonical(line)
        assert name in names, name
        assert importlib.metadata.version(name) in {one.version for one in found if one.name == name}
    running = {one.name for one in found if one.runs}
    assert {"numpy", "llvmlite", "apache-echarts", "inter", "starlette"} <= running
    assert not {"pytest", "mujoco-core", "pyright"} & running
    folders = [*bills.VENDORED.iterdir(), *bills.WEIGHTS.iterdir()]
    vendored = {path.name for path in folders if path.suffix in (".js", ".woff2", ".tflite")}
    assert sum(one.kind == "file" for one in found) == len(vendored)
    versions = {one.name: one.version for one in found if one.kind == "file"}
    assert versions["inter"] == "4.001"
    assert versions["mediapipe-pose"] == "0.5.1675469404"


def test_what_is_not_known_or_binds_is_named() -> None:
    (one, *_) = components()
    for wrong in ("unknown", "GPL-3.0-or-later", "Proprietary", "MIT AND GPL-2.0-only"):
        (said,) = doubts([dataclasses.replace(one, licence=wrong, runs=True)])
        assert wrong in said
    assert "no hash" in doubts([dataclasses.replace(one, hashes=())])[0]
    assert doubts([dataclasses.replace(one, licence="MIT OR Apache-2.0")]) == []
    assert licence_of("no-such-package-anywhere") == "unknown"
    assert "libx264" in table(components())


@pytest.mark.slow
def test_the_bill_is_cyclonedx_and_its_references_lead_somewhere() -> None:
    made = bill(components())
    assert made == bill(components())
    assert (made["bomFormat"], made["specVersion"]) == ("CycloneDX", "1.6")
    entries = made["components"]
    references = {entry["bom-ref"] for entry in entries}
    own = made["metadata"]["component"]["bom-ref"]
    for entry in made["dependencies"]:
        assert entry["ref"] in references | {own}
        assert set(entry["dependsOn"]) <= references
    assert {entry["ref"] for entry in made["dependencies"]} == references | {own}
    assert all(entry["licenses"] and entry["scope"] in ("required", "excluded") for entry in entries)


@pytest.mark.slow
def test_one_command_writes_it(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "supply_chain", "--out", str(tmp_path / "build" / "sbom.cdx.json")]
    done = subprocess.run(command, cwd=ROOT / "tests", capture_output=True, text=True, check=True)
    assert json.loads((tmp_path / "build" / "sbom.cdx.json").read_text()) == bill(components())
    assert "numpy" in done.stdout


def test_the_pythons_that_are_promised() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["requires-python"] == f">={'.'.join(map(str, OLDEST_PYTHON))}"
    promised = [entry.rpartition(" ")[2] for entry in project["classifiers"] if "Python :: 3." in entry]
    assert promised == ["3.11", "3.12", "3.13"]
