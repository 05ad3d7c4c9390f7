"""The doors (server and scene, command line) reach what lies on disk through the verbs in `operations` alone.

From the rooms below them they take types, constants, and functions of values (limb ends of a body, knobs of settings):
whatever reads or changes a session, a run, footage or what was made of them is a verb.
"""

import ast
import inspect

import pytest
from test_house_rules import ROOT

import studio

BEHIND = ("studio.sessions.", "studio.runs.", "studio.footage.", "studio.results.")
OF_VALUES = ("studio.sessions.names", "studio.runs.drawing.")
"""Words checked and pictures drawn: nothing on disk."""


def functions_taken(door: str) -> dict[str, set[str]]:
    """By module of a door, the functions that it imports from the rooms behind the verbs."""
    taken: dict[str, set[str]] = {}
    for path in sorted((ROOT / "studio" / door).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith(BEHIND):
                continue
            names = {one.name for one in node.names if one.name[0].islower()}
            if names and not f"{node.module}.".startswith(tuple(f"{one.rstrip('.')}." for one in OF_VALUES)):
                taken.setdefault(path.relative_to(ROOT).as_posix(), set()).update(names)
    return taken


STILL: dict[str, int] = {
    "studio/app/scene/body_view.py": 1,
    "studio/app/scene/controller.py": 1,
    "studio/app/scene/opened_run.py": 1,
    "studio/app/scene/pose_refining.py": 1,
    "studio/app/scene/recording.py": 1,
    "studio/app/scene/scene_pictures.py": 1,
    "studio/app/server/camera_routes.py": 1,
    "studio/app/server/import_routes.py": 1,
    "studio/cli/bench_commands.py": 2,
    "studio/cli/deriving.py": 1,
    "studio/cli/diagnostics_archive.py": 2,
    "studio/cli/launch.py": 1,
    "studio/cli/result_commands.py": 3,
    "studio/cli/self_check.py": 1,
}
"""Functions that a module still takes; a module that is mended leaves this table."""


@pytest.mark.parametrize("door", ["app", "cli"])
def test_doors_take_no_functions_from_behind_the_verbs(door: str) -> None:
    taken = {name: len(names) for name, names in functions_taken(door).items()}
    assert taken == {name: count for name, count in STILL.items() if name.startswith(f"studio/{door}/")}


MOST_PARAMETERS = 7


@pytest.mark.parametrize("room", ["operations", "app", "cli"])
def test_no_function_of_verbs_and_doors_declares_many_parameters(room: str) -> None:
    """What a verb takes beyond that is a request of its own (`taking`)."""
    many: list[str] = []
    for path in sorted((ROOT / "studio" / room).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
                names = [one.arg for one in (*node.args.posonlyargs, *node.args.args, *node.args.kwonlyargs)]
                if len(names) - (names[:1] in (["self"], ["cls"])) > MOST_PARAMETERS:
                    many.append(f"{path.name}: {node.name}")
    assert many == []


def test_verbs_take_booleans_by_name_alone() -> None:
    by_place = [
        f"studio.{name}({parameter.name})"
        for name in dir(studio)
        if name != "StudioError"
        for parameter in inspect.signature(getattr(studio, name)).parameters.values()
        if isinstance(parameter.default, bool) and parameter.kind is not parameter.KEYWORD_ONLY
    ]
    assert by_place == []
