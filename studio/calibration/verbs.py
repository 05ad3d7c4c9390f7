"""Cameras from board footage, from folders to a calibration file with its report."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from studio.calibration.board_checks import mirrored_cameras, mirrored_sightings, pair_findings
from studio.calibration.board_footage_reading import (
    AS_IT_IS,
    HowTaken,
    by_camera,
    chosen_for_lens,
    list_footage,
    look_for_lens,
    look_together,
    plain_names,
)
from studio.calibration.boards import Board, Sighting, of_camera
from studio.calibration.checks import check_calibration
from studio.calibration.detection import BoardFinder
from studio.calibration.extrinsics import Rig, moved, solve_rig
from studio.calibration.findings import Finding, blocking
from studio.calibration.floor import board_on_floor, clicked_floor, floor_from_board, read_clicks
from studio.calibration.intrinsics import FEWEST_PICTURES, Lens, lenses_of_file, solve_lens
from studio.calibration.lens_verdict import lens_findings
from studio.capture.naming import listed, natural_key
from studio.capture.sanity import common_target, quarter_turns
from studio.errors import CalibrationError
from studio.geometry.rigid import rigid
from studio.progress import Progress


@dataclass(frozen=True, slots=True, eq=False)
class Calibrated:
    """What came of it.

    lenses : camera → lens. rig : the placed cameras, None if only lenses were asked for. sightings : camera → those
    that its lens came from. findings : what blocks first. floor : how it was set, in words; "" if it was not.
    """

    board: Board
    lenses: Mapping[str, Lens]
    rig: Rig | None
    sightings: Mapping[str, tuple[Sighting, ...]]
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
    names : the cameras' names (default: the footage's). footage_sizes : of what is to be tracked, to compare.
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
    together = _together(board, extrinsics, names, _floor_frame(floor), taken, progress)
    used: dict[str, tuple[Sighting, ...]] = {}
    if lenses is None and intrinsics is not None and intrinsics.is_file():
        lenses = lenses_of_file(intrinsics, names)
    if lenses is None:
        used = _lens_sightings(board, intrinsics, names, together, taken, progress)
        lenses = _lenses(board, used, progress)
    findings = [finding for lens in lenses.values() for finding in lens_findings(lens)]
    everything = [*together, *(sighting for group in used.values() for sighting in group)]
    findings += mirrored_sightings(everything)
    if extrinsics is None:
        return Calibrated(board, lenses, None, used, _sorted(findings))
    missing = [name for name in names if name not in lenses]
    if missing:
        raise CalibrationError(f"Camera {listed(missing)} has no lens.", "Add its pictures of the board.")
    solved, floor_words, more = _placed(board, together, lenses, floor, refine_lenses, taken, progress)
    findings += more
    findings += check_calibration(
        solved.cameras, footage_sizes=footage_sizes, distances_mm=distances_mm, board=board
    )
    return Calibrated(board, lenses, solved, used, _sorted(findings), floor_words)


def _names(folder: Path | None) -> tuple[str, ...]:
    if folder is None:
        return ()
    return tuple(sorted(plain_names([entry.name for entry in list_footage(folder)]), key=natural_key))


def _floor_frame(floor: str | None) -> int | None:
    """The N of "frame:N", None for other ways to set the floor. Raises CalibrationError if N is no number."""
    if floor is None or not floor.startswith("frame:"):
        return None
    number = floor.removeprefix("frame:")
    if not number.isdigit():
        raise CalibrationError(
            f"The floor's frame '{number}' is no number.", "Write frame:120, counted from 0."
        )
    return int(number)


def _together(
    board: Board,
    folder: Path | None,
    names: Sequence[str],
    floor: int | None,
    taken: HowTaken,
    progress: Progress | None,
) -> list[Sighting]:
    if folder is None:
        return []
    footage = by_camera(list_footage(folder), names)
    pictures = all(entry.video is None for entry in footage.values())
    finder = BoardFinder(board, thorough=pictures)
    seen = look_together(finder, footage, progress, () if floor is None else (floor,), taken)
    return [entry.sighting for entry in seen]


def _lens_sightings(
    board: Board,
    folder: Path | None,
    names: Sequence[str],
    together: Sequence[Sighting],
    taken: HowTaken,
    progress: Progress | None,
) -> dict[str, tuple[Sighting, ...]]:
    """Camera → what its lens is solved from; cameras without any are left out only if their footage is missing."""
    if folder is None:
        return {name: of_camera(together, name) for name in names}
    found: dict[str, tuple[Sighting, ...]] = {}
    for name, entry in by_camera(list_footage(folder), names).items():
        finder = BoardFinder(board, thorough=entry.video is None)
        seen = look_for_lens(finder, name, entry, progress, taken)
        if len(seen) < FEWEST_PICTURES:
            raise CalibrationError(
                f"The board {board.spelling} is found in {len(seen)} pictures of camera {name}.",
                "Check the board's kind and numbers (inner corners for a chessboard), light and sharpness.",
            )
        found[name] = tuple(chosen_for_lens(seen)[0])
    return found


def _lenses(
    board: Board, used: Mapping[str, tuple[Sighting, ...]], progress: Progress | None
) -> dict[str, Lens]:
    found: dict[str, Lens] = {}
    for number, (name, sightings) in enumerate(used.items()):
        if progress is not None:
            progress(f"Solving the lens of camera {name}", number, len(used))
        if not sightings:
            raise CalibrationError(
                f"The board {board.spelling} is found in no picture of camera {name}.",
                "Check the board's kind and numbers, or show it to this camera.",
            )
        found[name] = solve_lens(board, sightings)
    return found


def _placed(
    board: Board,
    together: Sequence[Sighting],
    lenses: Mapping[str, Lens],
    floor: str | None,
    refine: bool,
    taken: HowTaken,
    progress: Progress | None,
) -> tuple[Rig, str, list[Finding]]:
    """The rig on its floor, how that was set, and what the pairs say. Raises CalibrationError for mirrored ones."""
    names = sorted({sighting.camera for sighting in together}, key=natural_key)
    silent = [name for name in lenses if name not in names]
    if silent:
        raise CalibrationError(
            f"The board is found in no picture of camera {listed(silent)} in the common footage.",
            "Carry the board through what this camera sees.",
        )
    for sighting in together:
        if sighting.size != lenses[sighting.camera].size:
            (a, b), (c, d) = sighting.size, lenses[sighting.camera].size
            raise CalibrationError(
                f"Camera {sighting.camera} recorded {a}x{b} pixels, its lens was calibrated at {c}x{d}.",
                "Record both with one mode of the camera.",
            )
    backwards = mirrored_cameras(board, together, lenses, names) if board.kind == "chessboard" else ()
    if backwards:
        raise CalibrationError(backwards[0].message, backwards[0].remedy)
    rig = solve_rig(board, together, lenses, refine_lenses=refine, progress=progress)
    findings = list(pair_findings(rig))
    new_from_old, words = _floor(board, rig, together, lenses, floor, taken, progress)
    rig = moved(rig, new_from_old)
    upright = tuple(replace(camera, quarter_turns=quarter_turns(camera)) for camera in rig.cameras)
    if not words:
        findings.append(
            Finding(
                "no-floor",
                "warns",
                "The floor was not set: up is what the cameras' pictures call up, and z = 0 is a guess.",
                "Lay the board on the floor in one frame and name it (--floor frame:N), or click points of the floor.",
            )
        )
    return replace(rig, cameras=upright), words, findings


def _floor(
    board: Board,
    rig: Rig,
    together: Sequence[Sighting],
    lenses: Mapping[str, Lens],
    floor: str | None,
    taken: HowTaken,
    progress: Progress | None,
) -> tuple[np.ndarray, str]:
    number = _floor_frame(floor)
    if floor is None:
        return _guessed_floor(rig), ""
    if number is not None:
        lying = [sighting for sighting in together if sighting.frame == number]
        if not lying:
            raise CalibrationError(
                f"No camera sees the board in frame {number}.", "Name a frame in which one does."
            )
        pose = rig.boards[number] if number in rig.boards else board_on_floor(rig, board, lying, lenses)
        return floor_from_board(pose, board.thickness_mm), f"board on the floor in frame {number}"
    path = Path(floor)
    if path.suffix.lower() == ".json":
        return clicked_floor(read_clicks(path), rig.cameras).new_from_old, f"points of {path.name}"
    footage = by_camera(list_footage(path), [camera.name for camera in rig.cameras])
    finder = BoardFinder(board)
    seen = []
    for name, entry in footage.items():
        found = look_for_lens(finder, name, entry, progress, taken)
        seen += [max(found, key=lambda each: each.sharpness).sighting] if found else []
    pose = board_on_floor(rig, board, seen, lenses)
    return floor_from_board(
        pose, board.thickness_mm
    ), f"board on the floor in '{path.name}', {len(seen)} cameras"


def _guessed_floor(rig: Rig) -> np.ndarray:
    """Up as the pictures have it, the floor 1 m under what the cameras look at."""
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
