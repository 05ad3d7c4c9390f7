"""Groups of verbs fired at once, each by a seed of its own; what is wrong after each; and the table of all of them."""

import contextlib
import os
import re
import signal
import subprocess
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import msgspec
import numpy as np
import psutil
from faults.process_kinds import PATIENCE, until
from faults.stage import DONE, NEW, frames_of

from races.stage import GONE, MARK, Outcome, Stage
from races.verbs import ALONE, LEFT, OVERWRITES, PYTHON, SERVED, SLOW, TRACKING, Given, There, plain
from studio.foundations.errors import StudioError
from studio.foundations.foreign_files import MANIFEST_NAME
from studio.operations.jobs.stream_recording import recording_folder
from studio.results.verifying import verify
from studio.runs.notes import notes_of
from studio.sessions.atomic_files import PARTIAL_PREFIX, discard
from studio.sessions.process_lock import ProcessLock
from studio.sessions.run_record import FILE_NAME as RECORD_NAME
from studio.sessions.session import RUNS_NAME, Session
from studio.sessions.stored_run import StoredRun
from studio.sessions.workspace import TRASH_NAME

RARE = 0.3
"""Verbs that take seconds come so often, where the others come once."""
KILLED = 0.3
"""In so many of the groups something is killed."""
SERVER_KILLED = 0.05
"""In so many of these it is the server, which takes seconds to start; in three times as many its tracking process."""
WITHIN = 0.08
"""Seconds in which all verbs of a group are fired."""
HERE = Path(__file__).parent
LET_GO_SECONDS = 60.0
CAUSELESS = re.compile(
    r"No such file|Errno|Traceback|fault of the studio|disk space|disk I/O|unable to open", re.I
)
"""Words of a refusal that name no cause, or a false one."""
RECORDED = recording_folder(Path("taken")).name.removeprefix("taken")
SEARCHING = ("tracking", "compiling", "starting", "preparing")


@dataclass
class Tally:
    """Of all groups. refusals : their words, by how often. wrong : the group's seed, its verbs, and what was wrong.
    commits : that they were fired at.
    """

    groups: int = 0
    done: int = 0
    refused: int = 0
    killed: int = 0
    seconds: float = 0.0
    pairs: set[frozenset[str]] = field(default_factory=set[frozenset[str]])
    refusals: dict[str, int] = field(default_factory=dict[str, int])
    wrong: list[str] = field(default_factory=list)
    commits: list[str] = field(default_factory=list)


def campaign(
    folder: Path,
    seeds: Sequence[int],
    verbs: Sequence[str],
    seconds: float = float("inf"),
    each: Callable[[str], None] = lambda line: None,
    kept: Path | None = None,
) -> Tally:
    """A group for each seed. seconds : begin none after that. each : called with what is wrong, as it comes. kept : a
    file of what earlier calls did, with which this one goes on: after the seeds of these, its numbers added to theirs.
    """
    tally = _begun(kept)
    seeds = seeds[tally.groups :]
    with Stage(folder) as stage:
        began = time.monotonic()
        for seed in seeds:
            if time.monotonic() - began > seconds:
                break
            begun = time.monotonic()
            fired, outcomes, wrong = group(stage, verbs, seed)
            tally.groups += 1
            tally.seconds += time.monotonic() - begun
            tally.pairs |= {frozenset((one, other)) for one in fired for other in fired if one != other}
            for outcome in outcomes:
                tally.done += outcome.state == "done"
                tally.killed += outcome.state == "killed"
                tally.refused += outcome.state == "refused"
                if outcome.state == "refused":
                    words = re.sub(r"[\w-]*\d[\w-]*", "#", outcome.words)
                    tally.refusals[words] = tally.refusals.get(words, 0) + 1
            for words in dict.fromkeys(wrong):
                tally.wrong.append(f"--seed {seed} --groups 1 ({', '.join(fired)}): {words}")
                each(tally.wrong[-1])
            if kept:
                kept.write_bytes(msgspec.json.encode(tally))
    return tally


def _begun(kept: Path | None) -> Tally:
    """What earlier calls did, with the commit of now among theirs."""
    tally = msgspec.json.decode(kept.read_bytes(), type=Tally) if kept and kept.is_file() else Tally()
    if kept and (commit := _commit()) not in tally.commits:
        tally.commits.append(commit)
    return tally


def _commit() -> str:
    words = ["git", "describe", "--always", "--dirty"]
    return subprocess.run(words, capture_output=True, text=True, check=False, cwd=HERE).stdout.strip()


def table(tally: Tally) -> str:
    """What became of the groups, and the refusals by how often they came."""
    each = tally.seconds / max(tally.groups, 1)
    lines = [
        f"{tally.groups} groups ({each:.2f} s each), {len(tally.pairs)} pairs of verbs: {tally.done} verbs done,"
        f" {tally.refused} refused, {tally.killed} killed; {len(tally.wrong)} wrong states"
        + "".join(f"; {commit}" for commit in tally.commits)
    ]
    return "\n".join(
        [*lines, *(f"{count:6} {words}" for words, count in Counter(tally.refusals).most_common(60))]
    )


def group(stage: Stage, verbs: Sequence[str], seed: int) -> tuple[list[str], list[Outcome], list[str]]:
    """Fire a group: the verbs, what became of each, and what is wrong afterwards."""
    rng = np.random.default_rng(seed)
    share = np.array([RARE if plain(verb) in SLOW else 1.0 for verb in verbs])
    fired = [str(verb) for verb in rng.choice(verbs, size=int(rng.integers(2, 4)), p=share / share.sum())]
    moments = rng.uniform(0.0, WITHIN, len(fired))
    strike = _strike(stage, rng, fired)
    with stage.given(seed) as given:
        begin = threading.Barrier(len(fired) + 1)
        with ThreadPoolExecutor(len(fired) + 1) as threads:
            under_way = [
                threads.submit(_fired, stage, given.at(place), verb, place, begin, moments[place])
                for place, verb in enumerate(fired)
            ]
            killing = threads.submit(_struck, begin, strike, float(rng.uniform(0.0, 4 * WITHIN)))
            outcomes = [one.result() for one in under_way]
            killing.result()
        stage.revive()
        _await_quiet(stage)
        wrong = [
            f"{verb}: {one.words}" for verb, one in zip(fired, outcomes, strict=True) if one.state == "wrong"
        ]
        wrong += _misleading(given, fired, outcomes)
        try:
            wrong += _judged(stage, given, fired, outcomes, killed=strike is not None)
        except StudioError as error:
            wrong.append(f"cannot be read any more: {error}")
    return fired, outcomes, wrong


# ---------------------------------------------------------------------- what is done


def _strike(stage: Stage, rng: np.random.Generator, fired: Sequence[str]) -> Callable[[], None] | None:
    """What is killed in this group, if anything is: of processes that have something to do in it."""
    if rng.random() > KILLED:
        return None
    share, tracks = rng.random(), any(verb in TRACKING for verb in fired)
    chosen = [place for place, verb in enumerate(fired) if verb in PYTHON]
    if len(chosen) < len(fired) and share < SERVER_KILLED:
        return lambda: _kill_server(stage)
    if tracks and (share < 4 * SERVER_KILLED or not chosen):
        return lambda: _kill_tracker(stage)
    return stage.others[int(rng.choice(chosen))].kill if chosen else None


def _kill_server(stage: Stage) -> None:
    process = psutil.Process(stage.served.process.pid)
    children = process.children()
    process.kill()
    stage.served.process.wait()
    # What it tracked with ends by itself.
    psutil.wait_procs(children, PATIENCE)


def _kill_tracker(stage: Stage) -> None:
    with contextlib.suppress(psutil.Error, AssertionError):
        os.kill(stage.served.tracker().pid, signal.SIGKILL)


def _struck(begin: threading.Barrier, strike: Callable[[], None] | None, after: float) -> None:
    begin.wait()
    if strike is not None:
        time.sleep(after)
        strike()


def _fired(
    stage: Stage, given: Given, verb: str, place: int, begin: threading.Barrier, moment: float
) -> Outcome:
    begin.wait()
    time.sleep(moment)
    if verb in PYTHON:
        return stage.others[place].do(verb, given)
    try:
        return _served(stage, given, verb)
    except httpx.TransportError:
        return Outcome("killed")


def _served(stage: Stage, given: Given, verb: str) -> Outcome:
    """Send a request, and wait for the work that it begins."""
    client = stage.served.client
    method, path, body = SERVED[verb](given)
    address = path if path.startswith("/api") else f"/api/sessions/{given.name}{path}"
    answer = client.request(method, address, json=body)
    said = answer.json() if answer.content else {}
    if not answer.is_success:
        words = f"{said.get('message')} {said.get('hint')}"
        return Outcome("wrong" if answer.status_code >= 500 else "refused", words)
    if answer.status_code != 202:
        return Outcome("done")
    of = said.get("session") or given.name
    key = said.get("identifier") or of
    if path.startswith("/api/comparisons"):
        key = f"{given.name}/{said.get('name')}"
    while True:
        jobs = client.get("/api/jobs", params={"session": of}).json()["jobs"]
        mine = [job for job in jobs if job["key"] == key]
        if not any(job["state"] in ("queued", "running", "cancelling") for job in mine):
            break
        time.sleep(0.02)
    failed = next((job for job in mine if job["state"] == "failed"), None)
    if failed is None:
        return Outcome("done")
    words = f"{failed['message']} {failed['hint']}"
    return Outcome("wrong" if " failed: " in failed["message"] else "refused", words)


def _await_quiet(stage: Stage) -> None:
    """Return when the server does nothing any more."""

    def quiet() -> bool:
        jobs = stage.served.client.get("/api/jobs").json()["jobs"]
        return stage.served.state() not in SEARCHING and not any(
            job["state"] in ("queued", "running", "cancelling") for job in jobs
        )

    until(quiet)


# ---------------------------------------------------------------------- what is wrong


def _misleading(given: Given, fired: Sequence[str], outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Refusals that do not say of what, or why."""
    for verb, outcome in zip(fired, outcomes, strict=True):
        if outcome.state != "refused" or outcome.words.startswith(ALONE):
            continue
        if given.name not in outcome.words and not re.search(
            rf"'({DONE}|{NEW}|{GONE}|[\w-]+-\d+-\d)'", outcome.words
        ):
            yield f"{verb} is refused and names nothing: {outcome.words}"
        if CAUSELESS.search(outcome.words):
            yield f"{verb} is refused with a false cause: {outcome.words}"
        gone = outcome.words.startswith("There is no session") or "renamed or deleted" in outcome.words
        if plain(verb) == "make a run" and "name" in outcome.words and not gone:
            yield f"{verb} is refused for a name that nobody gave: {outcome.words}"


def _judged(
    stage: Stage, given: Given, fired: Sequence[str], outcomes: Sequence[Outcome], *, killed: bool
) -> Iterator[str]:
    folders = [path for path in stage.root.iterdir() if not path.name.startswith(".")]
    trash = [*(stage.root / TRASH_NAME).iterdir()]
    thrown = [path for path in trash if not (path / MANIFEST_NAME).is_file()]
    places = [path for path in (*folders, *trash) if path not in thrown]
    for path in folders:
        # What was recorded until a kill is there to be made a session of.
        recorded = killed and path.name.endswith(RECORDED)
        if not recorded and not (path / MANIFEST_NAME).is_file():
            yield f"the folder '{path.name}' is no session"
    for path in thrown:
        if not (path / RECORD_NAME).is_file():
            yield f"the entry '{path.name}' of the trash is nothing"
    yield from _left_behind(stage.root, killed=killed)
    sessions = [Session(path) for path in places if (path / MANIFEST_NAME).is_file()]
    runs = [StoredRun(path) for path in thrown if (path / RECORD_NAME).is_file()]
    for session in sessions:
        yield from (f"verify: {fault.place} {fault.what}" for fault in verify(session).faults)
        for path in (session.path / RUNS_NAME).glob("*"):
            if not path.name.startswith(".") and not (path / RECORD_NAME).is_file():
                yield f"the folder '{path.name}' is no run"
        runs += session.runs()
    for session in sessions:
        if session.path.parent == stage.root and session.manifest.name != session.name and not killed:
            yield f"session '{session.name}' is called '{session.manifest.name}' in its description"
    if not sessions:
        yield "the session is gone"
    yield from _runs_wrong(stage, runs, fired, killed=killed)
    there = There(tuple(sessions), tuple(runs))
    for place, (verb, outcome) in enumerate(zip(fired, outcomes, strict=True)):
        left, writers = LEFT.get(plain(verb)), OVERWRITES.get(plain(verb), ())
        others = {plain(one) for at, one in enumerate(fired) if at != place}
        if (
            outcome.state == "done"
            and left
            and not others & set(writers)
            and not left(there, given.at(place))
            # Tracking is begun by a request, and what becomes of it is no answer.
            and verb != "served track"
        ):
            yield f"{verb} is said to be done, and nothing of it is there"
    yield from _movable(stage)
    yield from _locked(stage.root)


def _runs_wrong(
    stage: Stage, runs: Sequence[StoredRun], fired: Sequence[str], *, killed: bool
) -> Iterator[str]:
    marked = [run for run in runs if MARK in [note.text for note in notes_of(run)]]
    whole = [run for run in marked if frames_of(run) == stage.frames]
    copies = sum(plain(verb) == "duplicate" for verb in fired)
    if not whole:
        yield f"the run '{DONE}' is lost"
    for run in runs:
        summary = run.summary()
        if summary.damaged:
            yield f"run '{run.name}' has damaged frames"
        # The server may still have it open; what is tracked on a clock leaves frames out.
        if (
            summary.status != "tracking"
            and not run.record.live
            and (summary.status == "finished") != (summary.done == run.record.last - run.record.first)
        ):
            yield f"run '{run.name}' is {summary.status} with {summary.done} frames"
        # A kill between the two steps of renaming leaves the old name, which is read nowhere but in the trash.
        if not killed and run.folder.parent.name == RUNS_NAME and run.record.name != run.name:
            yield f"run '{run.name}' is called '{run.record.name}' in its record"
    if sum(run.record.name == GONE for run in runs) > 1 + copies:
        yield "a run was brought back twice"
    if not any(run.record.name == GONE and frames_of(run) == stage.frames for run in runs):
        yield f"the run '{GONE}' is lost"


def _left_behind(root: Path, *, killed: bool) -> Iterator[str]:
    """What nobody will remove; what a kill left is removed here."""
    for path in root.rglob(f"{PARTIAL_PREFIX}*"):
        if not killed:
            yield f"'{path.relative_to(root)}' is left behind"
        elif path.is_dir():
            discard(path)
        else:
            path.unlink(missing_ok=True)


def _locked(root: Path) -> Iterator[str]:
    for path in root.rglob("*.lock"):
        if path.name != "server.lock" and ProcessLock.is_held(path):
            yield f"'{path.relative_to(root)}' is still held"


def _movable(stage: Stage) -> Iterator[str]:
    """Whether the server lets the session and its runs go."""
    client = stage.served.client
    for session in client.get("/api/sessions").json()["sessions"]:
        if session.get("problem"):
            yield f"session '{session['name']}' is listed as unusable: {session['problem']}"
        deadline = time.monotonic() + LET_GO_SECONDS
        answer = client.delete(f"/api/sessions/{session['name']}")
        # What was requested of the tracking process may only begin now.
        while answer.status_code == 409 and time.monotonic() < deadline:
            time.sleep(0.1)
            answer = client.delete(f"/api/sessions/{session['name']}")
        if answer.status_code != 200:
            yield f"session '{session['name']}' cannot be deleted afterwards: {answer.text}"
