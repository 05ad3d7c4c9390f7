"""What the studio gave before its files moved into twelve rooms, beside what it gives now: `make as-before`.

The commit before the first move is checked out beside this one. Both track the same few frames with every tracker and
likelihood, export one of the runs in every format, print every command's help and describe their API. What differs is
printed. `as_before.json` keeps the hashes of the state before, with the processor that made them, and how the names
begin of what changed on purpose, with the reason.
"""

import argparse
import hashlib
import importlib
import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from click.testing import CliRunner
from llvmlite.binding import get_host_cpu_name

import studio

ROOT = Path(__file__).resolve().parents[2]
KEPT = Path(__file__).with_suffix(".json")
BEFORE = "1d18d228"
FRAMES = 3
KNOBS = {
    "annealed": {"particles": 40, "layers": 3},
    "swarm": {"stage1_particles": 5, "stage1_iterations": 4, "stage2_particles": 5, "stage2_iterations": 8},
}
FEW = {"particles": 120}
NO_POSES = ("viser", "html", "mp4", "nwb", "toml", "yml", "usd")
"""Formats whose files hold times, or which an extra writes: only that they are written counts."""


def main() -> int:
    """Compare; 1 where something differs that is not noted."""
    reader = argparse.ArgumentParser(description=__doc__)
    reader.add_argument("--collect", type=Path, help="write what the studio on the path gives into this file")
    reader.add_argument("--keep", action="store_true", help="keep the hashes of the state before")
    given = reader.parse_args()
    if given.collect:
        given.collect.write_text(json.dumps(collected(), indent=1, sort_keys=True) + "\n")
        return 0
    kept = json.loads(KEPT.read_text()) if KEPT.is_file() else {"changed": {}}
    with tempfile.TemporaryDirectory() as folder:
        if given.keep:
            checkout = Path(folder) / "before"
            subprocess.run(
                ["git", "worktree", "add", "--detach", str(checkout), BEFORE], cwd=ROOT, check=True
            )
            try:
                before = _collected_by(checkout, Path(folder) / "before.json")
            finally:
                subprocess.run(["git", "worktree", "remove", "--force", str(checkout)], cwd=ROOT, check=True)
            kept = {
                "commit": BEFORE,
                "processor": get_host_cpu_name(),
                "hashes": before,
                "changed": kept["changed"],
            }
            KEPT.write_text(json.dumps(kept, indent=1, sort_keys=True) + "\n")
        now = _collected_by(ROOT, Path(folder) / "now.json")
    if kept["processor"] != get_host_cpu_name():
        print(
            f"Kept on another processor ({kept['processor']}), where last digits differ: --keep makes it again."
        )
    before, noted = kept["hashes"], kept["changed"]
    differing = sorted(name for name in before.keys() | now.keys() if before.get(name) != now.get(name))
    unexplained = [name for name in differing if not name.startswith(tuple(noted))]
    for name in differing:
        words = "gone" if name not in now else "new" if name not in before else "differs"
        print(f"{words}: {name}{'' if name in unexplained else '   (on purpose)'}")
    print(
        f"{len(before)} things before, {len(now)} now: {len(differing)} differ, {len(unexplained)} unexplained."
    )
    return 1 if unexplained else 0


def _collected_by(checkout: Path, place: Path) -> dict[str, str]:
    environment = {
        **os.environ,
        "PYTHONPATH": str(checkout),
        "STUDIO_WORKSPACE": str(place.parent / place.stem),
    }
    subprocess.run(
        [sys.executable, __file__, "--collect", str(place)], cwd=checkout, env=environment, check=True
    )
    return json.loads(place.read_text())


def collected() -> dict[str, str]:
    """By name the hash of everything that the studio on the path gives."""
    return {**_poses_and_exports(), **_help(), **_api()}


def _poses_and_exports() -> dict[str, str]:
    trackers = _module("search.trackers.catalogue", "trackers.catalogue").TRACKERS
    likelihoods = _module("search.likelihood.catalogue", "likelihood.catalogue").WEIGHTINGS
    formats = _module("results.export.formats", "export.formats").FORMATS
    workspace = Path(os.environ["STUDIO_WORKSPACE"])
    for name in ("planar_arm", "walk"):
        shutil.copytree(Path.cwd() / "sample_sessions" / name, workspace / name)
    # What the walk's particles are guided by; the arm has no model, so that its runs of that kind are refused.
    model = workspace / "models" / "walking.behaviour"
    model.parent.mkdir()
    studio.learn([workspace / "walk" / "recipe.toml"], str(model), body="human31")
    hashes: dict[str, str] = {}
    for tracker in trackers:
        for likelihood in likelihoods:
            for session in ("planar_arm", "walk"):
                name = f"poses: {session}, {tracker}, {likelihood}"
                guided = {"behaviour": str(model)} if (tracker, session) == ("behaviour", "walk") else {}
                knobs = KNOBS.get(tracker, FEW)
                try:
                    run = studio.track(
                        session,
                        last=FRAMES,
                        tracker=tracker,
                        weighting=likelihood,
                        knobs=knobs,
                        seed=3,
                        **guided,
                    )
                    hashes[name] = hashlib.sha256(run.poses.tobytes()).hexdigest()
                except studio.StudioError as error:
                    hashes[name] = _hash(str(error))
    run = studio.track("walk", last=FRAMES, knobs=KNOBS["annealed"], name="exported")
    for form in formats:
        place = workspace / f"walk.{form}"
        try:
            studio.export_run(run, place)
        except studio.StudioError as error:
            hashes[f"export: {form}"] = _hash(str(error))
            continue
        written = place.read_bytes() if place.is_file() else b""
        hashes[f"export: {form}"] = "" if form in NO_POSES else hashlib.sha256(written).hexdigest()
    return hashes


def _help() -> dict[str, str]:
    main = _module("cli.main", "cli.main")
    called = {
        "command: studio": ["--help"],
        **{f"command: {name}": [name, "--help"] for name in main.COMMANDS},
    }
    return {name: _hash(CliRunner().invoke(main.main, words).output) for name, words in called.items()}


def _api() -> dict[str, str]:
    document = _module("app.server.api_document", "server.api_document").api_document()
    hashes = {
        f"address: {verb.upper()} {path}": _hash(json.dumps(_bare(entry), sort_keys=True))
        for path, entries in document["paths"].items()
        for verb, entry in entries.items()
    }
    for name, schema in document["components"]["schemas"].items():
        hashes[f"schema: {name}"] = _hash(json.dumps(_bare(schema), sort_keys=True))
    return hashes


def _bare(schema: object) -> object:
    """A schema without its descriptions and titles: what clients depend on."""
    if isinstance(schema, dict):
        return {key: _bare(one) for key, one in schema.items() if key not in ("description", "title")}
    return [_bare(one) for one in schema] if isinstance(schema, list) else schema


def _module(now: str, before: str) -> object:
    try:
        return importlib.import_module(f"studio.{now}")
    except ModuleNotFoundError:
        return importlib.import_module(f"studio.{before}")


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


if __name__ == "__main__":
    raise SystemExit(main())
