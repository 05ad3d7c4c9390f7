"""The rules of the pen that a machine can keep (the storeys' directions are kept by import-linter)."""

import ast
import re
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted((ROOT / "studio").rglob("*.py"))
VAGUE = {"util", "utils", "helper", "helpers", "common", "misc", "base", "manager", "core"}


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_file_is_short_and_says_what_it_is(path: Path) -> None:
    text = path.read_text()
    assert len(text.splitlines()) <= 300
    assert ast.get_docstring(ast.parse(text)), "every module opens with a docstring"
    assert path.stem not in VAGUE
    assert len(path.relative_to(ROOT / "studio").parts) <= 3
    if path.name == "__init__.py" and path.parent.name != "studio":
        assert len(text.splitlines()) <= 10


@pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))
def test_classes_and_functions_stay_small(path: Path) -> None:
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ClassDef):
            public = [
                item
                for item in node.body
                if isinstance(item, ast.FunctionDef)
                and item.name[0] != "_"
                and not any(isinstance(how, ast.Name) and how.id == "property" for how in item.decorator_list)
            ]
            assert len(public) <= 14, f"{node.name} has {len(public)} public methods"
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            assert (node.end_lineno or 0) - node.lineno <= 80, f"{node.name} is too long"


def test_no_global_random_numbers() -> None:
    for path in SOURCES:
        assert not re.search(r"np\.random\.(seed|rand|randn|normal|uniform|choice)\(", path.read_text()), path


def test_no_committed_file_names_an_address_to_download_from_or_a_machine() -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    lock = (ROOT / "requirements.lock").read_text()
    assert "://" not in lock
    assert "--hash=sha256:" in lock
    for name in listed.split():
        path = ROOT / name
        if (
            path.suffix in {".py", ".toml", ".md", ".html", ".css", ".js", ".lock"}
            and "vendor" not in path.parts
        ):
            assert "/root/" not in path.read_text().replace('"/root/"', ""), name
