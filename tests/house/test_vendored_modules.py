"""Vendored modules are imported by relative paths: the pages' policy allows no import map."""

import re

from studio.foundations.package import assets_folder
from studio.results.self_contained import modules_of

IMPORTED = re.compile(r'(?:from|import)\s*"([^"]+)"')


def test_no_vendored_module_imports_by_a_bare_name() -> None:
    folder = assets_folder() / "vendor"
    imported = {name for path in folder.glob("*.js") for name in IMPORTED.findall(path.read_text("utf-8"))}
    assert {"./preact.js", "./preact_hooks.js", "./signals_core.js"} <= imported
    assert {name for name in imported if not name.startswith("./")} == set()


def test_a_page_without_a_server_brings_what_components_are_made_of() -> None:
    brought = set(modules_of("js/studio/component.js"))
    made_of = ("preact", "preact_hooks", "signals", "signals_core", "htm")
    assert {f"vendor/{name}.js" for name in made_of} <= brought
