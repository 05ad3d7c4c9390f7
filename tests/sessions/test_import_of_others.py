"""Sources as other programs and phones leave them: read as they are meant, doubts said at import."""

import dataclasses
import struct
import tomllib
import zipfile
from fractions import Fraction
from pathlib import Path

import av
import numpy as np
import pytest
import tomli_w
from sources import BODY, FRAMES, video_source, write_pose2sim
from toy_footage import number_of, numbered_frame, rig, write_pictures, write_video

import studio
from studio.body.catalogue import load_body
from studio.body.subject import DEFAULT_BODY
from studio.footage.capture.calibration_files import read_calibration
from studio.footage.capture.video import measure_video
from studio.foundations.errors import BodyError, CalibrationError, FootageError
from studio.runs.setup.workflow import calibration_step
from studio.sessions.background_files import mask_name
from studio.sessions.importers.importing import ImportOptions, ImportReport, import_source
from studio.sessions.named_rows import write_pose
from studio.sessions.session import Session


def imported(source: Path, **options: object) -> ImportReport:
    return import_source(
        source, source.parent / f"made-{len(list(source.parent.iterdir()))}", ImportOptions(**options)
    )


def numbers(session: Session) -> dict[str, list[int]]:
    footage = session.footage()
    try:
        return {
            name: [number_of(footage.picture(name, frame)) for frame in range(footage.frame_count)]
            for name in footage.cameras
        }
    finally:
        footage.close()


def losing(source: Path, frames: int, lost: int) -> Path:
    """Two cameras at 60 a second, the second without frame `lost`; each picture shows its number in time."""
    video_source(source, frames=frames)
    kept = [number for number in range(frames) if number != lost]
    write_video(source / "videos" / "cam02.mp4", [numbered_frame(n, 1) for n in kept], fps=60, pts=kept)
    return source


def test_a_lost_frame_is_refused_and_paired_by_time(tmp_path: Path) -> None:
    source = losing(tmp_path / "source", 40, 20)
    with pytest.raises(FootageError, match="Camera cam_2 lost frames: 1 before frame 20") as caught:
        imported(source)
    assert "--by-time" in caught.value.hint
    taken = imported(source, fps=60.0)
    assert any("lost frames" in warning for warning in taken.warnings)
    paired = imported(source, by_time=True)
    seen = numbers(paired.session)
    assert seen["cam_1"] == list(range(40))
    assert seen["cam_2"] == [*range(20), 19, *range(21, 40)]
    assert any("paired by time" in note for note in paired.notes)


def test_masks_made_of_paired_frames_are_found_again(tmp_path: Path) -> None:
    session = imported(losing(tmp_path / "source", 40, 20), by_time=True).session
    source = session.manifest.footage.cameras[1]
    assert [mask_name(source, frame) for frame in (19, 20, 21)] == ["000019.png", "000019.png", "000020.png"]


def test_a_session_is_paired_by_time_later(tmp_path: Path) -> None:
    session = imported(losing(tmp_path / "source", 40, 20), fps=60.0).session
    assert numbers(session)["cam_2"][20] == 21
    paired = studio.synchronise(session, by_time=True)
    assert paired.change is not None
    assert numbers(paired.session)["cam_2"] == [*range(20), 19, *range(21, 40)]
    moved = studio.synchronise(paired.session, offsets={"cam_1": 1}).session
    assert not any(camera.steps for camera in moved.manifest.footage.cameras)


def test_thirty_beside_sixty_a_second(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source", frames=40)
    write_video(source / "videos" / "cam02.mp4", [numbered_frame(2 * n, 1) for n in range(20)], fps=30)
    with pytest.raises(FootageError, match="frame rates differ") as caught:
        imported(source)
    assert "--by-time" in caught.value.hint
    session = imported(source, by_time=True).session
    assert session.manifest.fps == 30.0
    seen = numbers(session)
    assert seen["cam_1"] == seen["cam_2"]
    assert len(seen["cam_1"]) == 20


def trimmed(path: Path, frames: int, hidden: int) -> Path:
    """An mp4 whose edit list hides the first frames, as trimming without encoding makes it."""
    whole = write_video(
        path.with_name("whole.mp4"), [numbered_frame(n) for n in range(frames)], fps=60, gop=250, options={}
    )
    with av.open(str(whole)) as reading, av.open(str(path), "w") as writing:
        stream = reading.streams.video[0]
        target = writing.add_stream_from_template(stream)
        packets = [packet for packet in reading.demux(stream) if packet.size]
        zero = sorted(packet.pts for packet in packets)[hidden]
        for packet in packets:
            packet.pts -= zero
            packet.dts -= zero
            packet.stream = target
            writing.mux(packet)
    return path


def test_frames_that_an_edit_list_hides_do_not_count(tmp_path: Path) -> None:
    path = trimmed(tmp_path / "cut.mp4", 40, 10)
    assert measure_video(path).frame_count == 30
    content = path.read_bytes()
    path.write_bytes(content[: int(0.6 * len(content))])
    with pytest.raises(FootageError):
        measure_video(path)


def turned_by_its_file(path: Path) -> None:
    content = bytearray(path.read_bytes())
    at = content.find(b"tkhd") + 4 + 24 + 16
    content[at : at + 36] = struct.pack(">9i", -65536, 0, 0, 0, -65536, 0, 128 << 16, 96 << 16, 0x40000000)
    path.write_bytes(content)


def test_what_a_file_turns_itself_is_said(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    turned_by_its_file(source / "videos" / "cam01.mp4")
    assert any("cam01.mp4 by 180 degrees" in note for note in imported(source).notes)


PERSON = np.zeros((96, 128), np.uint8)
PERSON[20:80, 40:70] = 1


@pytest.mark.parametrize(
    ("form", "options", "words"),
    [
        (lambda one: one * 255, {}, ""),
        (lambda one: one, {}, "labels (1)"),
        (lambda one: one * 3, {}, "labels (3)"),
        (lambda one: (one.astype(np.uint16)) * 65535, {}, ""),
        (lambda one: one.astype(np.uint16) * 2, {}, "labels (2)"),
        (lambda one: np.dstack([np.full_like(one, 200)] * 3 + [one * 255]), {}, "alpha channel"),
        (lambda one: 255 - one * 255, {"masks": "inverted"}, ""),
    ],
)
def test_masks_mean_the_person(tmp_path: Path, form: object, options: dict[str, object], words: str) -> None:
    source = video_source(tmp_path / "source")
    for camera in ("cam01", "cam02"):
        write_pictures(source / "masks" / camera, [form(PERSON)] * FRAMES)  # type: ignore[operator]
    report = imported(source, **options)
    assert not [warning for warning in report.warnings if "masks" in warning]
    assert any(words in note for note in report.notes)
    footage = report.session.footage()
    mask = footage.mask("cam_1", FRAMES - 1)
    footage.close()
    assert mask is not None
    np.testing.assert_array_equal(mask > 0, PERSON > 0)


@pytest.mark.parametrize(
    ("mask", "words"),
    [(255 - PERSON * 255, "--masks inverted"), (np.zeros_like(PERSON), "empty in every frame")],
)
def test_masks_of_no_person_are_named(tmp_path: Path, mask: np.ndarray, words: str) -> None:
    source = video_source(tmp_path / "source")
    for camera in ("cam01", "cam02"):
        write_pictures(source / "masks" / camera, [mask] * FRAMES)
    assert sum(words in warning for warning in imported(source).warnings) == 2


@pytest.mark.parametrize(
    "place",
    [
        "videos/Camera{}/0.mp4",
        "cam{}/take-cam{}.mp4",
        "Videos/Cam{}/InputMedia/walk1/walk1_sync.mp4",
        "DCIM{}/100/A.MP4",
    ],
)
def test_a_folder_a_camera(tmp_path: Path, place: str) -> None:
    source = tmp_path / "source"
    for number in (1, 2):
        path = source / place.format(number, number)
        path.parent.mkdir(parents=True)
        write_video(path.with_suffix(".mp4"), [numbered_frame(n, number) for n in range(FRAMES)], fps=60)
        path.with_suffix(".mp4").rename(path)
    write_pose2sim(source / "calibration" / "Calib.toml", rig(2, "cam_"))
    seen = numbers(imported(source).session)
    assert seen == {"cam_1": list(range(FRAMES)), "cam_2": list(range(FRAMES))}


def in_unit(source: Path, factor: float) -> Path:
    path = source / "calibration" / "Calib.toml"

    document = tomllib.loads(path.read_text())
    for table in document.values():
        table["translation"] = [1000.0 * value * factor for value in table["translation"]]
    path.write_text(tomli_w.dumps(document))
    return source


@pytest.mark.parametrize(
    ("unit", "factor"), [("cm", 0.1), ("in", 1 / 25.4), ("board=50", 1 / 50), ("board=25.5mm", 1 / 25.5)]
)
def test_units_and_doubts_of_them(tmp_path: Path, unit: str, factor: float) -> None:
    source = in_unit(video_source(tmp_path / "source"), factor)
    wanted = [camera.centre for camera in rig(2, "cam_")]
    report = imported(source, unit=unit)
    assert not report.warnings
    np.testing.assert_allclose([camera.centre for camera in report.session.cameras()], wanted, atol=0.01)
    if factor * 3000 < 100.0:
        return
    doubtful = imported(source)
    assert any("has no room" in warning and "--unit" in warning for warning in doubtful.warnings)
    step = calibration_step(doubtful.session)
    assert step.state == "stale"
    assert "has no room" in step.why
    with pytest.raises(CalibrationError, match="no unit"):
        imported(source, unit="board=x")


def test_a_stereo_rig_is_no_mistake(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    first, _ = rig(2, "cam_")
    beside = first.centre + 120.0 * first.rotation[0]

    second = dataclasses.replace(first, name="cam_2", translation=-first.rotation @ beside)
    write_pose2sim(source / "calibration" / "Calib.toml", (first, second))
    assert not [warning for warning in imported(source).warnings if "unit" in warning or "metres" in warning]


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
def test_windows_editors(tmp_path: Path, encoding: str) -> None:
    source = video_source(tmp_path / "source")
    for path, text in (
        (source / "calibration" / "Calib.toml", (source / "calibration" / "Calib.toml").read_text()),
        (source / "subject.toml", 'body = "human31"\nheight_mm = 1780\n'),
    ):
        path.write_text(text, encoding=encoding)
    subject = imported(source).session.subject()
    assert subject.height_mm == 1780


def test_a_start_pose_in_degrees_is_noticed(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    names = [entry.name for entry in BODY.parameters]
    angle = next(entry.name for entry in BODY.parameters if entry.kind == "angle")
    rows = [
        f"{90.0 if name == angle else value:.4f}" for name, value in zip(names, BODY.neutral, strict=True)
    ]
    (source / "start_pose.csv").write_text(";".join(names) + "\n" + ";".join(rows).replace(".", ",") + "\n")
    with pytest.raises(BodyError, match=f"90 for '{angle}': angles are in radians"):
        imported(source)


def test_a_source_that_names_no_body_has_the_usual_one_or_that_of_its_start_pose(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    assert imported(source).session.manifest.body == DEFAULT_BODY
    other = load_body("human34")
    write_pose(source / "start_pose.csv", tuple(one.name for one in other.parameters), other.neutral)
    (source / "subject.toml").write_text("[dimensions_mm]\npelvis_length = 190\n")
    session = imported(source).session
    assert session.manifest.body == "human34"
    assert session.start_pose() is not None
    assert session.body().dimensions["pelvis_length"] == 190.0


def test_causes_are_named(tmp_path: Path) -> None:
    phones = tmp_path / "phones"
    write_pose2sim(phones / "calibration" / "Calib.toml", rig(2, "cam_"))
    for name in ("cam1", "cam2"):
        (phones / "videos" / name).mkdir(parents=True)
        (phones / "videos" / name / "IMG_1.HEIC").write_bytes(b"heic")
    with pytest.raises(FootageError, match=r"2 \.heic files"):
        imported(phones)
    linked = video_source(tmp_path / "linked")
    (linked / "videos" / "cam02.mp4").unlink()
    (linked / "videos" / "cam02.mp4").symlink_to("/nowhere/cam02.mp4")
    with pytest.raises(FootageError, match="a link to a file that does not exist"):
        imported(linked)
    motive = tmp_path / "Calibration.cal"
    motive.write_bytes(bytes(range(256)) * 4)
    with pytest.raises(CalibrationError, match="Motive"):
        read_calibration(motive)


def test_a_zip_with_backslashes(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    packed = tmp_path / "take.zip"
    with zipfile.ZipFile(packed, "w") as archive:
        for path in source.rglob("*"):
            if path.is_file():
                info = zipfile.ZipInfo()
                info.filename = "take\\" + str(path.relative_to(source)).replace("/", "\\")
                archive.writestr(info, path.read_bytes())
    assert len(import_source(packed, tmp_path / "unzipped").session.cameras()) == 2


def test_several_takes_in_folders_of_cameras(tmp_path: Path) -> None:
    source = tmp_path / "source"
    write_pose2sim(source / "calibration" / "Calib.toml", rig(2, "cam_"))
    for camera in (1, 2):
        (source / f"cam{camera}").mkdir()
        for take, first in (("walk", 0), ("run", 100)):
            pictures = [numbered_frame(first + k, camera) for k in range(FRAMES)]
            write_video(source / f"cam{camera}" / f"{take}-cam{camera}.mp4", pictures, fps=60)
    with pytest.raises(FootageError, match="2 trials"):
        imported(source)
    assert numbers(imported(source, trial="run").session)["cam_2"] == [100 + k for k in range(FRAMES)]
    for camera in (1, 2):
        for at, path in enumerate(sorted((source / f"cam{camera}").iterdir())):
            path.rename(path.with_name(f"IMG_{camera}{at}7.mp4"))
    with pytest.raises(FootageError, match="none has the same name in all"):
        imported(source)


def test_stamps_that_tremble_in_a_short_video_are_even(tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    steps = [max(0, round(1000 * k + rng.uniform(-250.0, 250.0))) for k in range(40)]
    with av.open(str(tmp_path / "a.mp4"), "w") as container:
        stream = container.add_stream("libx264", rate=60)
        stream.width, stream.height, stream.pix_fmt = 128, 96, "yuv420p"
        stream.codec_context.time_base = Fraction(1, 60_000)
        for at, step in enumerate(steps):
            frame = av.VideoFrame.from_ndarray(numbered_frame(at), format="bgr24")
            frame.pts, frame.time_base = step, Fraction(1, 60_000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode())
    found = measure_video(tmp_path / "a.mp4")
    assert (found.fps, found.uneven_frame) == (60.0, -1)


def test_a_calibration_in_inches_names_them(tmp_path: Path) -> None:
    source = video_source(tmp_path / "source")
    place = source / "calibration" / "Calib.toml"
    document = tomllib.loads(place.read_text())
    for entry in document.values():
        entry["translation"] = [1000.0 / 25.4 * value for value in entry["translation"]]
    place.write_text(tomli_w.dumps(document))
    report = imported(source, allow_inconsistent=True)
    assert any("--unit in would make it 3" in warning for warning in report.warnings), report.warnings
