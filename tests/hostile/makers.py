"""The hostile sessions: each maker spoils a copy of a small session with a finished run, `done`."""

import io
import json
import os
import shutil
import sqlite3
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import zstandard
from store_records import layer_of, record_of, result_of
from toy_session import facing_camera, make_session, side_camera

from studio.results.export.exporting import export_run
from studio.results.export.formats import FORMATS
from studio.sessions.named_rows import write_pose
from studio.sessions.results_store import ResultsWriter

SECRET = "what lies outside and is nobody's business"
NAME, RUN = "take", "done"
HUGE = 20 << 30
"""Bytes of a file that has no content."""
Maker = Callable[[Path, Path], None]
MAKERS: dict[str, Maker] = {}


def make_plain(workspace: Path) -> Path:
    """The session before it is spoilt."""
    session = make_session(workspace / NAME, frames=3, cameras=(facing_camera(), side_camera()))
    body = session.body()
    names = tuple(entry.name for entry in body.parameters)
    write_pose(session.path / "start_pose.csv", names, body.neutral)
    run = session.new_run(record_of(session, RUN))
    with ResultsWriter(run.folder) as writer:
        writer.write_settings(1, 0, 0, {"particles": 12, "layers": 2})
        for frame in range(3):
            writer.write_frame(result_of(frame), [layer_of(frame, layer) for layer in range(2)], 2000)
    (session.path / "truth").mkdir()
    export_run(session, run, FORMATS["trc"], {}, session.path / "truth" / "arm.trc")
    cv2.imwrite(str(session.path / "thumbnail.jpg"), np.zeros((8, 8, 3), np.uint8))
    return session.path


def make_nothing(_folder: Path, _outside: Path) -> None:
    """The session as it is."""


def make_outside(folder: Path) -> None:
    """What no session may reach: a secret as anything that a session could hold."""
    folder.mkdir()
    for name in ("secret.txt", "secret.toml", "secret.csv", "secret.json"):
        (folder / name).write_text(SECRET)
    (folder / "secret.jsonl").write_text(json.dumps({"time": 0.0, "level": "info", "text": SECRET}) + "\n")
    for part in ("runs", "calibration", "truth", "bodies", "videos"):
        (folder / part).mkdir()
        (folder / part / "secret.txt").write_text(SECRET)
    with sqlite3.connect(folder / "other.sqlite") as other:
        other.execute("CREATE TABLE mine (text)")
        other.execute("INSERT INTO mine VALUES (?)", (SECRET,))
    other.close()


def hostile(maker: Maker) -> Maker:
    """Add a maker under its function's name."""
    MAKERS[maker.__name__.removeprefix("_")] = maker
    return maker


def _replaced(path: Path) -> Path:
    """The path, without what lay there."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    path.unlink(missing_ok=True)
    path.parent.mkdir(parents=True, exist_ok=True)
    return path


PLACES = {
    "thumbnail": "thumbnail.jpg",
    "log": f"runs/{RUN}/log.jsonl",
    "moved_knobs": f"runs/{RUN}/moved_knobs.json",
    "run_cameras": f"runs/{RUN}/cameras.toml",
    "run_record": f"runs/{RUN}/run.json",
    "store": f"runs/{RUN}/results.sqlite",
    "lock": f"runs/{RUN}/results.lock",
    "wal": f"runs/{RUN}/results.sqlite-wal",
    "cameras": "calibration/cameras.toml",
    "subject": "subject.toml",
    "start_pose": "start_pose.csv",
    "truth": "truth/true.trc",
    "made_from": "made_from.json",
    "evidence": "evidence.json",
    "strokes": "strokes.json",
    "checksums": ".checksums.json",
    "exclusion": "exclusions/front.png",
    "track": f"runs/{RUN}/tracks/smooth.npz",
}
"""The files of a session that are read, by what they are."""
SECRETS = {
    ".jsonl": "secret.jsonl",
    ".json": "secret.json",
    ".toml": "secret.toml",
    ".sqlite": "other.sqlite",
}


def _add(name: str, make: Callable[[Path, Path], object], place: str) -> None:
    MAKERS[name] = lambda session, outside: make(_replaced(session / place), outside) and None


for _what, _place in PLACES.items():
    _target = SECRETS.get(Path(_place).suffix, "secret.txt")
    _add(f"{_what} is a link outside", lambda path, out, to=_target: path.symlink_to(out / to), _place)
for _what in (
    "thumbnail",
    "log",
    "moved_knobs",
    "run_cameras",
    "run_record",
    "store",
    "cameras",
    "evidence",
    "start_pose",
):
    _add(f"{_what} is a device", lambda path, _: path.symlink_to("/dev/zero"), PLACES[_what])
    _add(f"{_what} is a pipe", lambda path, _: os.mkfifo(path), PLACES[_what])
for _what in (
    "thumbnail",
    "log",
    "moved_knobs",
    "run_record",
    "cameras",
    "evidence",
    "start_pose",
    "exclusion",
):

    def _sparse(path: Path, _: Path) -> None:
        with path.open("wb") as file:
            file.truncate(HUGE)

    _add(f"{_what} is of {HUGE >> 30} GB", _sparse, PLACES[_what])
for _part in ("runs", "calibration", "truth", "bodies", "exclusions", "comparisons", "background"):
    _add(
        f"{_part} is a folder outside",
        lambda path, out, part=_part: path.symlink_to(
            out / (part if part in ("runs", "calibration", "truth", "bodies") else "videos")
        ),
        _part,
    )
for _part in (
    f"runs/{RUN}",
    f"runs/{RUN}/body",
    f"runs/{RUN}/exports",
    f"runs/{RUN}/tracks",
    "calibration/earlier",
):
    _add(f"{_part} is a folder outside", lambda path, out: path.symlink_to(out / "videos"), _part)
_add("the lock is to be made outside", lambda path, out: path.symlink_to(out / "made"), PLACES["lock"])
_add("a picture is a pipe", lambda path, _: os.mkfifo(path), "pictures/front/0001.png")
_add("a mask is a device", lambda path, _: path.symlink_to("/dev/zero"), "masks/front/0001.png")
_add("the manifest is a pipe", lambda path, _: os.mkfifo(path), "session.json")
_add("the manifest is deep", lambda path, _: path.write_text("[" * 200_000), "session.json")


def _manifest(session: Path, change: Callable[[dict[str, Any]], None]) -> None:
    content = json.loads((session / "session.json").read_text())
    change(content)
    (session / "session.json").write_text(json.dumps(content))


def _add_manifest(name: str, change: Callable[[dict[str, Any]], object]) -> None:
    MAKERS[name] = lambda session, _: _manifest(session, lambda content: change(content) and None)


_add_manifest("1e308 frames per second", lambda content: content["footage"].update(fps=1e308))
_add_manifest("a frame rate below zero", lambda content: content["footage"].update(fps=-3.0))
_add_manifest("10^18 frames", lambda content: content["footage"].update(frame_count=10**18))
_add_manifest("an unlikely time of change", lambda content: content.update(footage_changed="yesterday"))
_add_manifest("no such body", lambda content: content.update(body="../../outside/secret"))
_add_manifest(
    "footage above the session", lambda content: content["footage"]["cameras"][0].update(path="../../outside")
)
_add_manifest(
    "the session itself as footage", lambda content: content["footage"]["cameras"][0].update(path=".")
)
_add_manifest(
    "masks at an address",
    lambda content: content["footage"]["cameras"][0].update(masks="http://127.0.0.1:9/x.mp4"),
)
_add_manifest("pictures of 10^9 pixels", lambda content: content["footage"]["cameras"][0].update(width=10**9))
_add_manifest(
    "escape sequences in the title", lambda content: content.update(title="a\x1b]0;owned\x07\x1b[31mb")
)
_add_manifest("escape sequences in a note", lambda content: content.update(notes=["\x1b[2J\x9b31m"]))


def _record(session: Path, change: dict[str, Any]) -> None:
    path = session / "runs" / RUN / "run.json"
    path.write_text(json.dumps(json.loads(path.read_text()) | change))


for _name, _change in {
    "a run of 10^18 frames": {"last": 10**18},
    "a run that ends before it begins": {"first": 3, "last": 1},
    "a run at 1e308 frames per second": {"fps": 1e308},
    "a run made at no time": {"created": "now"},
    "a run with a short start pose": {"start_pose": [0.0]},
    "a run of an unknown tracker": {"tracker": "none", "weighting": "none"},
    "a run whose software begins a formula": {"software": "1\n=cmd|' /C calc'!A0"},
    "a run with unlikely settings": {"settings": {"particles": "many", "layers": -1}},
}.items():
    MAKERS[_name] = lambda session, _, change=_change: _record(session, change)


def _stored(session: Path, *statements: str | tuple[str, tuple[object, ...]]) -> None:
    with sqlite3.connect(session / "runs" / RUN / "results.sqlite") as store:
        for statement in statements:
            if isinstance(statement, str):
                store.execute(statement)
            else:
                store.execute(*statement)
    store.close()


ENDLESS = "WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n)"
for _name, _statements in {
    "meta is an endless view": (
        "DROP TABLE meta",
        f"CREATE VIEW meta AS {ENDLESS} SELECT CAST(i AS TEXT) AS key, 'x' AS value FROM n",
    ),
    "frames is an endless view": (
        "ALTER TABLE frames RENAME TO others",
        f"CREATE VIEW frames AS {ENDLESS} SELECT i AS frame, 0.0 AS log_weight, 0.0 AS milliseconds, 1 AS evaluations,"
        " 1 AS layers, 1 AS settings_version, zeroblob(32) AS pose, x'00' AS blob FROM n",
    ),
    "a trigger": (
        f"CREATE TRIGGER t AFTER INSERT ON meta BEGIN INSERT INTO settings {ENDLESS} SELECT i, 1, 1, '' FROM n; END",
    ),
    "a computed column": (
        "DROP TABLE arrivals",
        "CREATE TABLE arrivals (frame INTEGER PRIMARY KEY, arrived REAL AS (length(zeroblob(900000000))), ready REAL)",
    ),
    "a pose of one byte": ("UPDATE frames SET pose = x'01' WHERE frame = 1", "DELETE FROM checksums"),
    "poses of one byte": ("UPDATE frames SET pose = x'01'", "DELETE FROM checksums"),
    "a pose that is no number": (
        ("UPDATE frames SET pose = ? WHERE frame = 1", (np.full(4, np.nan).tobytes(),)),
        "DELETE FROM checksums",
    ),
    "a pose that is a text": ("UPDATE frames SET pose = 'words'", "DELETE FROM checksums"),
    "a weight that is a text": ("UPDATE frames SET log_weight = 'heavy'", "DELETE FROM checksums"),
    "counts that are texts": ("UPDATE frames SET layers = 'x', evaluations = x'00'", "DELETE FROM checksums"),
    "a frame of 2^62": (
        "UPDATE frames SET frame = 4611686018427387904 WHERE frame = 2",
        "DELETE FROM checksums",
    ),
    "checksums that are no checksums": ("UPDATE checksums SET sums = '[[1e999'",),
    "settings that are a number": ("UPDATE settings SET \"values\" = '7'", "DELETE FROM checksums"),
    "an unlikely schema": ("UPDATE meta SET value = '99999999999999999999' WHERE key = 'schema'",),
    "an unlikely time taken": ("INSERT OR REPLACE INTO meta VALUES ('time', '[')",),
    "a state of tracking that is none": ("INSERT OR REPLACE INTO tracking VALUES (1, 'x', 'y', 'z')",),
    "no tables": ("DROP TABLE frames", "DROP TABLE meta"),
}.items():
    MAKERS[_name] = lambda session, _, statements=_statements: _stored(session, *statements)


@hostile
def _a_result_that_unpacks_to_4_GB(session: Path, _: Path) -> None:
    bomb = zstandard.ZstdCompressor().compress(bytes(1 << 30)) * 1
    _stored(
        session,
        ("UPDATE frames SET blob = ?", (bomb,)),
        ("UPDATE layers SET blob = ?", (bomb,)),
        "DELETE FROM checksums",
    )


@hostile
def _a_track_of_4_GB(session: Path, _: Path) -> None:
    path = _replaced(session / PLACES["track"])
    head = io.BytesIO()
    np.lib.format.write_array_header_1_0(head, {"descr": "<f8", "fortran_order": False, "shape": (1 << 29,)})
    with (
        zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as packed,
        packed.open("poses.npy", "w", force_zip64=True) as member,
    ):
        member.write(head.getvalue())
        for _number in range(512):
            member.write(bytes(1 << 20))
    # The index says more than there is.
    content = path.read_bytes()
    path.write_bytes(content)


@hostile
def _a_link_that_leads_to_itself(session: Path, _: Path) -> None:
    _replaced(session / "subject.toml").symlink_to("subject.toml")
    _replaced(session / "truth").symlink_to(".")


@hostile
def _names_that_are_no_names(session: Path, _: Path) -> None:
    for name in ("-rf", "a b", "\x1b[31m", "con"):
        shutil.copytree(session / "runs" / RUN, session / "runs" / name)
