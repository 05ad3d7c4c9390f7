"""The rules of the pen that a machine can keep (the storeys' directions are kept by import-linter)."""

import ast
import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SOURCES = sorted((ROOT / "studio").rglob("*.py"))
VAGUE = {"util", "utils", "helper", "helpers", "common", "misc", "base", "manager", "core"}


def test_every_module_says_what_it_is() -> None:
    for path in SOURCES:
        assert ast.get_docstring(ast.parse(path.read_text())), f"{path} opens without a docstring"
        assert path.stem not in VAGUE, path


def test_no_global_random_numbers() -> None:
    for path in SOURCES:
        assert not re.search(r"np\.random\.(seed|rand|randn|normal|uniform|choice)\(", path.read_text()), path


def test_no_committed_file_names_an_address_to_download_from_or_a_machine() -> None:
    listed = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    lock = (ROOT / "requirements.lock").read_text()
    assert "://" not in lock
    assert "--hash=sha256:" in lock
    tools = (ROOT / "package-lock.json").read_text()
    assert '"integrity": "sha512-' in tools
    assert '"resolved"' not in tools
    for name in listed.split():
        path = ROOT / name
        if (
            path.suffix in {".py", ".toml", ".md", ".html", ".css", ".js", ".lock"}
            and "vendor" not in path.parts
        ):
            assert "/root/" not in path.read_text().replace('"/root/"', ""), name
