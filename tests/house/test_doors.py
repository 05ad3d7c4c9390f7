"""The doors (server and scene, command line) reach what lies on disk through the verbs in `operations` alone.

From the rooms below them they take types, constants, and functions of values (limb ends of a body, knobs of settings):
whatever reads or changes a session, a run, footage or what was made of them is a verb.
"""

import ast
import inspect

import pytest
from pydantic import BaseModel
from test_house_rules import ROOT

import studio
from studio import arena, extending
from studio.app.server.app import ROUTES

BEHIND = ("studio.sessions.", "studio.runs.", "studio.footage.", "studio.results.")
OF_VALUES = (
    "studio.sessions.names.",
    "studio.sessions.object_stores.is_address",
    "studio.runs.drawing.",
    "studio.results.evaluation.errors.limb_of_drawn",
    "studio.results.evaluation.report.",
    "studio.results.export.overlay_video.even_sized",
    "studio.results.export.task.agreed",
)
"""Words checked and written, pictures drawn and padded, a body's limbs: nothing on disk."""


def functions_taken(door: str) -> dict[str, set[str]]:
    """By module of a door, the functions that it imports from the rooms behind the verbs."""
    taken: dict[str, set[str]] = {}
    for path in sorted((ROOT / "studio" / door).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if not isinstance(node, ast.ImportFrom) or not (node.module or "").startswith(BEHIND):
                continue
            names = {one.name for one in node.names if one.name[0].islower()}
            if names := {name for name in names if not f"{node.module}.{name}".startswith(OF_VALUES)}:
                taken.setdefault(path.relative_to(ROOT).as_posix(), set()).update(names)
    return taken


STILL: dict[str, int] = {
    "studio/app/scene/opened_run.py": 1,
    "studio/app/server/import_routes.py": 1,
    "studio/cli/bench_commands.py": 2,
    "studio/cli/diagnostics_archive.py": 2,
    "studio/cli/launch.py": 1,
    "studio/cli/result_commands.py": 1,
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


MOST_ANSWERS = 50


def fields_of_records() -> list[set[str]]:
    """The fields of each record of the rooms below the doors."""
    return [
        {
            one.target.id
            for one in node.body
            if isinstance(one, ast.AnnAssign) and isinstance(one.target, ast.Name)
        }
        for path in sorted((ROOT / "studio").rglob("*.py"))
        if path.relative_to(ROOT / "studio").parts[0] not in ("app", "cli", "garden")
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ClassDef)
    ]


def test_the_server_has_few_answers_of_its_own_and_none_repeats_a_record() -> None:
    """What verbs return is answered as it is."""
    own: dict[str, type[BaseModel]] = {}
    for route in ROUTES:
        model = getattr(route, "response_model", None)
        if inspect.isclass(model) and model.__module__.startswith("studio.app"):
            own[model.__name__] = model
    assert 20 < len(own) <= MOST_ANSWERS
    records = fields_of_records()
    repeated = [
        name
        for name, model in own.items()
        if len(model.model_fields) > 2 and any(model.model_fields.keys() <= fields for fields in records)
    ]
    assert repeated == []


def test_booleans_are_given_by_name_alone() -> None:
    """To verbs, and to what packages that add to the studio take."""
    others = ("StudioError", "arena")
    functions = {f"studio.{name}": getattr(studio, name) for name in dir(studio) if name not in others}
    offered = [
        (module.__name__, name, getattr(module, name))
        for module in (extending, arena)
        for name in dir(module)
    ]
    for module, name, one in offered:
        members = vars(one).items() if inspect.isclass(one) else [("", one)]
        functions |= {
            f"{module}.{name}.{part}": member
            for part, member in members
            if inspect.isfunction(member) and not part.startswith("_")
        }
    by_place = [
        f"{name}({parameter.name})"
        for name, function in functions.items()
        for parameter in inspect.signature(function).parameters.values()
        if isinstance(parameter.default, bool) and parameter.kind is not parameter.KEYWORD_ONLY
    ]
    assert len(functions) > 80
    assert by_place == []
