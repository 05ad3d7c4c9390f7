"""The footage of experiments and its evidence, so that trials on the same frames compute them once.

The cache belongs to one process. It holds the evidence of whole sequences, the pictures only where a weighting reads
them (about 2.5 MB a frame of four 640 × 480 cameras without), and drops the least recently used first.
"""

import dataclasses
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
from cachetools import LRUCache

from studio.evidence.backgrounds import Backgrounds
from studio.evidence.frame_evidence import FrameEvidence
from studio.evidence.pipeline import EvidenceMaker
from studio.evidence.settings import EvidenceSettings
from studio.footage.capture.footage import Footage
from studio.foundations.errors import SessionError
from studio.foundations.geometry.camera import Camera
from studio.sessions.object_stores import below, is_address
from studio.sessions.remote_sessions import remote_session, work_folder
from studio.sessions.session import Session

MOST_BYTES = 3_000_000_000
NO_PICTURE = np.zeros((0, 0, 3), np.uint8)
MOST_PREPARED = 3
"""Number of prepared sequences kept; one of visual hulls takes some 100 MB."""

T = TypeVar("T")


class FootageCache:
    """Sessions of rendered recipes by name, below one place; close it when done. Not for several threads.

    place : a folder, or an address of a store, whose sessions are brought once. folder : where what is made of them
    lies.
    """

    def __init__(self, place: Path | str, most_bytes: int = MOST_BYTES) -> None:
        self.place = str(place)
        self.folder = work_folder(self.place) if is_address(place) else Path(place)
        self._brought: dict[str, Session] = {}
        self._evidence = LRUCache[Hashable, FrameEvidence](
            most_bytes, lambda evidence: min(_size(evidence), most_bytes)
        )
        self._prepared = LRUCache[Hashable, Any](MOST_PREPARED)
        self._open: tuple[Hashable, EvidenceMaker] | None = None
        self._footage: tuple[Path, Footage, Backgrounds] | None = None

    def session(self, name: str) -> Session:
        """A recipe's session, or any by its folder's path or its address. Raises SessionError where there is none."""
        if is_address(name) or is_address(self.place):
            address = name if is_address(name) else below(self.place, name)
            if address not in self._brought:
                self._brought[address] = remote_session(address)
            return self._brought[address]
        path = Path(name) if Path(name).is_absolute() else self.folder / name
        if path == Path(name) and not (path / "session.json").is_file():
            raise SessionError(
                f"There is no session at '{path}'.",
                "Where it was renamed meanwhile, do this again under its new name; other machines reach it by an"
                " address alone.",
            )
        if not (path / "session.json").is_file():
            raise SessionError(
                f"The footage '{name}' is not in '{self.folder}'.", f"Make it: studio synthesize {name}."
            )
        return Session(path)

    def evidence(
        self,
        session: Session,
        cameras: tuple[Camera, ...],
        frame: int,
        settings: EvidenceSettings,
        edge_kind: str,
        pictures: bool = False,
    ) -> FrameEvidence:
        """The evidence of a frame, with pictures only if `pictures`. Raises FootageError, NotFoundError."""
        made_by = (session.path, tuple(camera.name for camera in cameras), settings, edge_kind, pictures)
        key = (made_by, frame)
        if key in self._evidence:
            return self._evidence[key]
        if self._open is None or self._open[0] != made_by:
            footage, backgrounds = self._opened(session)
            self._open = (made_by, EvidenceMaker(cameras, footage, backgrounds, settings, edge_kind))
        seen = self._open[1].evidence(frame)
        if not pictures:
            seen = dataclasses.replace(
                seen, views=tuple(dataclasses.replace(view, picture=NO_PICTURE) for view in seen.views)
            )
        self._evidence[key] = seen
        return seen

    def prepared(self, key: Hashable, make: Callable[[], T]) -> T:
        """The result of `make`, computed once a key; only the last few are kept."""
        if key not in self._prepared:
            self._prepared[key] = make()
        return cast("T", self._prepared[key])

    def close(self) -> None:
        """Close files and drop everything kept."""
        self._evidence.clear()
        self._prepared.clear()
        self._open = None
        if self._footage is not None:
            self._footage[1].close()
            self._footage = None

    def _opened(self, session: Session) -> tuple[Footage, Backgrounds]:
        """The session's footage, opened, with its background models; the one before is closed."""
        if self._footage is None or self._footage[0] != session.path:
            if self._footage is not None:
                self._footage[1].close()
            footage = session.footage()
            self._footage = (session.path, footage, Backgrounds(footage))
        return self._footage[1:]


def _size(evidence: FrameEvidence) -> int:
    maps = [(view.mask, view.edges, view.picture, view.unknown, view.shadow) for view in evidence.views]
    return sum(one.nbytes for of_view in maps for one in of_view if one is not None)
