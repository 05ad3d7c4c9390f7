"""Cameras from board footage, from folders to a calibration file with its report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from studio.footage.calibration.board_checks import mirrored_cameras, mirrored_detections, pair_findings
from studio.footage.calibration.board_footage_reading import (
    AS_IT_IS,
    HowTaken,
    by_camera,
    chosen_for_lens,
    list_footage,
    look_for_lens,
    look_together,
    plain_names,
)
from studio.footage.calibration.boards import Board, Detection, of_camera
from studio.footage.calibration.checks import check_calibration
from studio.footage.calibration.detection import BoardFinder
from studio.footage.calibration.extrinsics import Rig, moved, solve_rig
from studio.footage.calibration.findings import Finding, blocking
from studio.footage.calibration.floor import board_on_floor, clicked_floor, floor_from_board, read_clicks
from studio.footage.calibration.intrinsics import FEWEST_PICTURES, Lens, lenses_of_file, solve_lens
from studio.footage.calibration.lens_verdict import lens_findings
from studio.footage.capture.naming import listed, natural_key
from studio.footage.capture.sanity import common_target, quarter_turns
from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.geometry.rigid import rigid
from studio.foundations.progress import Progress, no_progress


@dataclass(frozen=True, slots=True, eq=False)
class Calibrated:
    """The result of a calibration.

    lenses : camera → lens. rig : the placed cameras, None if only lenses were requested. detections : camera → those
    that its lens came from. findings : blocking ones first. floor : how it was set, as text; "" if it was not.
    """

    board: Board
    lenses: Mapping[str, Lens]
    rig: Rig | None
    detections: Mapping[str, tuple[Detection, ...]]
    findings: tuple[Finding, ...]
    floor: str = ""


def calibrate(
    board: Board,
    *,
    intrinsics: Path | None = None,
    extrinsics: Path | None = None,
    floor: str | None = None,
    lenses: Mapping[str, Lens] | None = None,
    names: Sequence[str] = (),
    footage_sizes: Mapping[str, tuple[int, int]] | None = None,
    distances_mm: Mapping[tuple[str, str], float] | None = None,
    refine_lenses: bool = False,
    taken: HowTaken = AS_IT_IS,
    progress: Progress | None = None,
) -> Calibrated:
    """Solve the cameras from a folder of board footage for the lenses, and one of footage of all cameras at once.

    intrinsics may also be a calibration file, of which the lenses are taken. Without it (and `lenses`) the lenses come
    from the extrinsic footage too. floor : "frame:N" of the extrinsic footage in which the board lies on the floor, a
    folder with pictures of it lying there, or a .json of clicked points.
    names : the cameras' names (default: the footage's). footage_sizes : of the footage to be tracked, to compare.
    taken : turns of all board footage, and offsets of the common one.
    progress(step, done, total) may raise to stop; nothing is written here. Raises CalibrationError, FootageError.
    """
    if intrinsics is None and extrinsics is None:
        raise CalibrationError("There is no board footage to calibrate from.", "Give a folder of it.")
    if extrinsics is None and intrinsics is not None and intrinsics.is_file():
        raise CalibrationError(
            "Lenses of a file alone give no cameras.", "Give footage of all cameras at once."
        )
    names = tuple(names) or _names(extrinsics or intrinsics)

    def solved(pattern: Board) -> Calibrated:
        solving = _Solving(pattern, names, floor, taken, progress or no_progress)
        return _solved(
            solving, intrinsics, extrinsics, lenses, footage_sizes, distances_mm, refine_lenses=refine_lenses
        )

    try:
        return solved(board)
    except _NotFound as problem:
        meant = _meant_board(board, (intrinsics, extrinsics), problem, taken)
    solution = solved(meant)
    return replace(solution, findings=_sorted([*solution.findings, _meant_finding(board, meant)]))


def _solved(
    solving: "_Solving",
    intrinsics: Path | None,
    extrinsics: Path | None,
    lenses: Mapping[str, Lens] | None,
    footage_sizes: Mapping[str, tuple[int, int]] | None,
    distances_mm: Mapping[tuple[str, str], float] | None,
    *,
    refine_lenses: bool,
) -> Calibrated:
    """The calibration by one board; parameters as of `calibrate`."""
    board, names = solving.board, solving.names
    together = solving.together(extrinsics) if extrinsics is not None else []
    used: dict[str, tuple[Detection, ...]] = {}
    if lenses is None and intrinsics is not None and intrinsics.is_file():
        lenses = lenses_of_file(intrinsics, names)
    if lenses is None:
        used = solving.lens_detections(intrinsics, together)
        lenses = solving.lenses(used)
    findings = [finding for lens in lenses.values() for finding in lens_findings(lens)]
    findings += mirrored_detections(
        [*together, *(detection for group in used.values() for detection in group)]
    )
    if extrinsics is None:
        return Calibrated(board, lenses, None, used, _sorted(findings))
    missing = [name for name in names if name not in lenses]
    if missing:
        raise CalibrationError(f"Camera {listed(missing)} has no lens.", "Add its pictures of the board.")
    solved, floor_words, more = solving.placed(together, lenses, refine_lenses)
    findings += more
    findings += check_calibration(
        solved.cameras, footage_sizes=footage_sizes, distances_mm=distances_mm, board=board
    )
    return Calibrated(board, lenses, solved, used, _sorted(findings), floor_words)


class _NotFound(CalibrationError):
    """The board is found in too few pictures."""


def _meant_board(
    board: Board, folders: Sequence[Path | None], problem: CalibrationError, taken: HowTaken
) -> Board:
    """The board as it may have been meant, where that is found in the first camera's pictures: drawn by OpenCV before
    4.6 (or after), columns and rows exchanged. Raises `problem` where none is.
    """
    folder = next((one for one in folders if one is not None and one.is_dir()), None)
    if folder is None:
        raise problem
    first = list_footage(folder)[0]
    for meant in _other_spellings(board):
        finder = BoardFinder(meant, thorough=False, mirrored_too=False)
        if len(look_for_lens(finder, first.name, first, no_progress, taken)) >= FEWEST_PICTURES:
            return meant
    raise problem


def _other_spellings(board: Board) -> tuple[Board, ...]:
    turned = replace(board, columns=board.rows, rows=board.columns)
    if board.kind == "chessboard":
        fewer = [
            replace(board, columns=board.columns - less, rows=board.rows - less)
            for less in (1, -1)
            if min(board.columns, board.rows) > 3
        ]
        return (turned, *fewer)
    legacy = [replace(one, legacy=not board.legacy) for one in (board, turned)]
    return (legacy[0], turned, legacy[1])


def _meant_finding(given: Board, meant: Board) -> Finding:
    how = [
        *(
            ["with columns and rows exchanged"]
            if (meant.columns, meant.rows) == (given.rows, given.columns)
            else []
        ),
        *(["as OpenCV before 4.6 drew it (legacy)"] if meant.legacy and not given.legacy else []),
        *(["as OpenCV since 4.6 draws it (not legacy)"] if given.legacy and not meant.legacy else []),
    ]
    what = " and ".join(how) or "with its inner corners counted"
    return Finding(
        "board-pattern",
        "warns",
        f"The board {given.text} is in no picture; it was found {what}.",
        f"Give it as --board {meant.text}.",
    )


def _names(folder: Path | None) -> tuple[str, ...]:
    if folder is None:
        return ()
    return tuple(sorted(plain_names([entry.name for entry in list_footage(folder)]), key=natural_key))


@dataclass(frozen=True, slots=True, eq=False)
class _Solving:
    """The inputs of all steps, as of `calibrate`."""

    board: Board
    names: Sequence[str]
    floor: str | None
    taken: HowTaken
    progress: Progress

    @property
    def floor_frame(self) -> int | None:
        """The N of "frame:N", None for other ways to set the floor. Raises CalibrationError if N is no number."""
        if self.floor is None or not self.floor.startswith("frame:"):
            return None
        number = self.floor.removeprefix("frame:")
        if not number.isdigit():
            raise CalibrationError(
                f"The floor's frame '{number}' is no number.", "Write frame:120, counted from 0."
            )
        return int(number)

    def together(self, folder: Path) -> list[Detection]:
        footage = by_camera(list_footage(folder), self.names)
        finder = BoardFinder(self.board, thorough=all(entry.video is None for entry in footage.values()))
        also = () if self.floor_frame is None else (self.floor_frame,)
        return [entry.detection for entry in look_together(finder, footage, self.progress, also, self.taken)]

    def lens_detections(
        self, folder: Path | None, together: Sequence[Detection]
    ) -> dict[str, tuple[Detection, ...]]:
        """Camera → the detections for its lens; cameras without any are left out only if their footage is missing."""
        if folder is None:
            return {name: of_camera(together, name) for name in self.names}
        chosen: dict[str, tuple[Detection, ...]] = {}
        for name, entry in by_camera(list_footage(folder), self.names).items():
            finder = BoardFinder(self.board, thorough=entry.video is None)
            seen = look_for_lens(finder, name, entry, self.progress, self.taken)
            if len(seen) < FEWEST_PICTURES:
                raise _NotFound(
                    f"The board {self.board.text} is found in {len(seen)} pictures of camera {name}.",
                    "Check the board's kind and numbers (inner corners for a chessboard), light and sharpness. Tried as"
                    " well: columns and rows exchanged, and ,legacy (OpenCV before 4.6).",
                )
            chosen[name] = tuple(chosen_for_lens(seen)[0])
        return chosen

    def lenses(self, used: Mapping[str, tuple[Detection, ...]]) -> dict[str, Lens]:
        solved: dict[str, Lens] = {}
        for number, (name, detections) in enumerate(used.items()):
            self.progress(f"Solving the lens of camera {name}", number, len(used))
            if not detections:
                raise _NotFound(
                    f"The board {self.board.text} is found in no picture of camera {name}.",
                    "Check the board's kind and numbers, or show it to this camera.",
                )
            solved[name] = solve_lens(self.board, detections)
        return solved

    def placed(
        self, together: Sequence[Detection], lenses: Mapping[str, Lens], refine: bool
    ) -> tuple[Rig, str, list[Finding]]:
        """The rig on its floor, how that was set, and findings of pairs. Raises CalibrationError for mirrored ones."""
        names = sorted({detection.camera for detection in together}, key=natural_key)
        silent = [name for name in lenses if name not in names]
        if silent:
            raise _NotFound(
                f"The board is found in no picture of camera {listed(silent)} in the common footage.",
                "Carry the board through this camera's view.",
            )
        for detection in together:
            if detection.size != lenses[detection.camera].size:
                (a, b), (c, d) = detection.size, lenses[detection.camera].size
                raise CalibrationError(
                    f"Camera {detection.camera} recorded {a}x{b} pixels, its lens was calibrated at {c}x{d}.",
                    "Record both with one mode of the camera.",
                )
        chessboard = self.board.kind == "chessboard"
        backwards = mirrored_cameras(self.board, together, lenses, names) if chessboard else ()
        if backwards:
            raise CalibrationError(backwards[0].message, backwards[0].remedy)
        rig = solve_rig(self.board, together, lenses, refine_lenses=refine, progress=self.progress)
        findings = list(pair_findings(rig))
        new_from_old, words = self._floor(rig, together, lenses)
        rig = moved(rig, new_from_old)
        upright = tuple(replace(camera, quarter_turns=quarter_turns(camera)) for camera in rig.cameras)
        if not words:
            message = (
                "The floor was not set: the up axis is that of the cameras' pictures, and z = 0 is a guess."
            )
            remedy = "Lay the board on the floor in one frame and name it (--floor frame:N), or click floor points."
            findings.append(Finding("no-floor", "warns", message, remedy))
        return replace(rig, cameras=upright), words, findings

    def _floor(
        self, rig: Rig, together: Sequence[Detection], lenses: Mapping[str, Lens]
    ) -> tuple[Array, str]:
        number = self.floor_frame
        if self.floor is None:
            return _guessed_floor(rig), ""
        path = Path(self.floor)
        if number is not None:
            lying = [detection for detection in together if detection.frame == number]
            if not lying:
                raise CalibrationError(
                    f"No camera sees the board in frame {number}.", "Name a frame in which one does."
                )
            known = rig.boards.get(number)
            pose = board_on_floor(rig, self.board, lying, lenses) if known is None else known
            words = f"board on the floor in frame {number}"
        elif path.suffix.lower() == ".json":
            return clicked_floor(read_clicks(path), rig.cameras).new_from_old, f"points of {path.name}"
        else:
            seen: list[Detection] = []
            finder = BoardFinder(self.board)
            footage = by_camera(list_footage(path), [camera.name for camera in rig.cameras])
            for name, entry in footage.items():
                looks = look_for_lens(finder, name, entry, self.progress, self.taken)
                seen += [max(looks, key=lambda each: each.sharpness).detection] if looks else []
            pose = board_on_floor(rig, self.board, seen, lenses)
            words = f"board on the floor in '{path.name}', {len(seen)} cameras"
        return floor_from_board(pose, self.board.thickness_mm), words


def _guessed_floor(rig: Rig) -> Array:
    """A world with the pictures' up axis, and the floor 1 m below the point that the cameras face."""
    up = -np.mean([camera.rotation[1] for camera in rig.cameras], axis=0)
    up = up / np.linalg.norm(up)
    target = common_target(rig.cameras)
    middle = np.mean([camera.centre for camera in rig.cameras], axis=0) if target is None else target
    ahead = rig.cameras[0].rotation[2] - (rig.cameras[0].rotation[2] @ up) * up
    x = ahead / np.linalg.norm(ahead) if np.linalg.norm(ahead) > 1e-6 else rig.cameras[0].rotation[0]
    turn = np.stack([x, np.cross(up, x), up])
    return rigid(turn, -turn @ (middle - 1000.0 * up))


def _sorted(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    unique = list(dict.fromkeys(findings))
    stops = blocking(unique)
    return (*stops, *(finding for finding in unique if finding.severity != "blocks"))
