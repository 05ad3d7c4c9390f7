"""Two rendered people, crossing, shaking hands, one hiding the other: each tracked as well as he is alone.

The clips are rendered (minutes), or taken from the folder that STUDIO_FOOTAGE names: `studio synthesize` leaves them
there under their own names.
"""

import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

import studio
from studio.body.forward_kinematics import limb_ends, marker_points
from studio.body.motion_files.trc import read_trc
from studio.foundations.arrays import Array
from studio.results.drawing_footage.recipes import synthesize
from studio.runs.tracks import read_track
from studio.sessions.session import Session
from studio.sessions.stored_run import StoredRun

pytestmark = pytest.mark.slow

PAIRS = ("pair-crossing", "pair-handshake", "pair-occluding")
SEEDS = (0, 1, 2)
LOST = 100.0
"""mm: a limb that is farther off, and nearer to some place of the other's body than to its own, is exchanged."""


@dataclass(frozen=True, slots=True, eq=False)
class Pair:
    """together, alone : (session of each) with both in view and with one."""

    together: tuple[Session, Session]
    alone: tuple[Session, Session]


@pytest.fixture(scope="module", params=PAIRS)
def pair(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Pair:
    name, folder = request.param, tmp_path_factory.mktemp(request.param)
    kept = os.environ.get("STUDIO_FOOTAGE", "")
    whole, one, other = (_clip(f"{name}{end}", folder, kept) for end in ("", "-one", "-other"))
    stands = [_stands(session) for session in (one, other)]
    names = [str(folder / "first"), str(folder / "second")]
    made = studio.subjects(whole, at=stands, into=names)
    studio.together(names[0], [names[1]])
    first, second = (Session(session.path) for session in made.sessions)
    return Pair((first, second), (one, other))


def _clip(name: str, folder: Path, kept: str) -> Session:
    path = Path(kept) / name
    return Session(path if kept and path.is_dir() else synthesize(name, folder / name))


def _stands(session: Session) -> tuple[float, float]:
    """x and y, metres, of the start pose."""
    start = session.start_pose()
    x, y = limb_ends(session.body(), start[None])[0].reshape(-1, 3)[:, :2].mean(axis=0) / 1000.0
    return float(x), float(y)


def _places(run: StoredRun, names: tuple[str, ...]) -> Array:
    """(F, M, 3) mm of markers, in the search's own track of all frames."""
    body, own = run.body(), tuple(marker.name for marker in run.body().markers)
    return marker_points(body, read_track(run).poses)[:, [own.index(name) for name in names]]


@pytest.mark.timeout(5400)
def test_each_is_as_near_as_alone_and_no_limb_is_exchanged(pair: Pair) -> None:
    truths = [read_trc(path) for session in pair.alone if (path := session.truth_path) is not None]
    bodies = [session.body() for session in pair.alone]
    names = tuple(marker.name for marker in bodies[0].markers if marker.name in truths[0].names)
    true = [found.positions[:, [found.names.index(name) for name in names]] for found in truths]
    errors = np.zeros((2, 2, len(SEEDS)))
    for row, sessions in enumerate((pair.alone, pair.together)):
        for who, session in enumerate(sessions):
            for column, seed in enumerate(SEEDS):
                found = _places(studio.track(session, seed=seed).run, names)
                assert found.shape == true[who].shape
                off = np.linalg.norm(found - true[who], axis=2)
                errors[row, who, column] = off.mean()
                if row:
                    others = true[1 - who]
                    apart = np.linalg.norm(found[:, :, None] - others[:, None], axis=3).min(axis=2)
                    exchanged = (off > LOST) & (apart < off)
                    assert not exchanged.any(), (session.name, seed, np.argwhere(exchanged))
                    hip = names.index("Hip")
                    assert (off[:, hip] < np.linalg.norm(found[:, hip] - others[:, hip], axis=1)).all()
    alone, together = errors.mean(axis=2)
    print(f"alone {errors[0].round(1).tolist()}, together {errors[1].round(1).tolist()} mm")
    assert (together <= 1.3 * alone).all(), (together / alone).tolist()
