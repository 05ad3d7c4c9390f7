"""Every byte of a session is read through `studio.foundations.foreign_files`, its databases through
`sessions.session_databases`.

What opens a file itself is listed here with what that file is: never one that came with a session.
"""

import ast
from pathlib import Path

from test_house_rules import ROOT, SOURCES

READING = frozenset(("read_bytes", "read_text"))
OPENING = frozenset(("open", "fdopen", "memmap", "fromfile", "loadtxt", "genfromtxt", "imread"))
MODULES_THAT_READ = frozenset(
    (
        "studio/foundations/foreign_files.py",
        "studio/sessions/session_databases.py",
        "studio/foundations/arrays.py",
    )
)
OPENS_ITSELF = {
    "studio/search/behaviour/model_file.py": "writes a model",
    "studio/body/catalogue.py": "the package's own bodies",
    "studio/footage/capture/pictures.py": "PyAV, of a path that was checked",
    "studio/footage/capture/stream_files.py": "writes a recording",
    "studio/footage/capture/video.py": "PyAV, of a path that was checked",
    "studio/cli/main.py": "the package's own sources",
    "studio/cli/tracking_commands.py": "writes a table where the command says",
    "studio/results/export/bvh_writing.py": "an export, in a folder made for it",
    "studio/results/export/overlay_video.py": "an export, in a folder made for it",
    "studio/results/export/table_files.py": "an export, in a folder made for it",
    "studio/foundations/kernel_cache.py": "compiled kernels, which have checks of their own",
    "studio/runs/drawing/colour_tokens.py": "the package's own colours",
    "studio/results/self_contained.py": "the package's own pages",
    "studio/sessions/samples.py": "the package's own samples",
    "studio/app/scene/scene_pictures.py": "an export, in a folder made for it",
    "studio/cli/self_check.py": "a database of its own, in a temporary folder",
    "studio/operations/jobs/camera_service.py": "cameras, not files",
    "studio/app/server/guide_routes.py": "the package's own guide",
    "studio/app/server/pages.py": "the package's own pages",
    "studio/app/server/upload_routes.py": "writes an upload, in a folder made for it",
    "studio/sessions/archives.py": "an archive that was checked, and what it unpacks",
    "studio/sessions/atomic_files.py": "writes temporary files; folders, to sync them",
    "studio/sessions/importers/writing.py": "copies a source into a folder made for it",
    "studio/sessions/live_recordings.py": "writes a recording",
    "studio/sessions/run_log.py": "appends to a file that was checked",
}
GARDEN = ("studio/garden/reproduction/", "studio/garden/benchmarks/", "studio/results/drawing_footage/")
"""They read what they made themselves."""


def readings(path: Path) -> set[str]:
    """The calls in a module that read or open a file without asking."""
    found: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if not isinstance(node, ast.Call):
            continue
        match node.func:
            case ast.Attribute(value=ast.Name(id="sqlite3"), attr="connect"):
                found.add("sqlite3.connect")
            case ast.Attribute(value=ast.Name(id="np"), attr="load"):
                found.add("np.load")
            case ast.Attribute(attr=name) if name in READING | OPENING:
                found.add(name)
            case ast.Name(id="open"):
                found.add("open")
            case _:
                pass
    return found


def test_sessions_are_read_in_one_place() -> None:
    by_module = {path.relative_to(ROOT).as_posix(): readings(path) for path in SOURCES}
    elsewhere = {
        name: calls
        for name, calls in by_module.items()
        if calls and name not in MODULES_THAT_READ | OPENS_ITSELF.keys() and not name.startswith(GARDEN)
    }
    assert elsewhere == {}
    assert {name for name in OPENS_ITSELF if not by_module[name]} == set()
    databases = {name for name, calls in by_module.items() if "sqlite3.connect" in calls}
    assert databases == {
        "studio/sessions/session_databases.py",
        "studio/foundations/kernel_cache.py",
        "studio/cli/self_check.py",
    }
    assert not any("np.load" in calls for name, calls in by_module.items() if not name.startswith(GARDEN))
