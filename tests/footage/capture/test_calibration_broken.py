"""Broken calibrations of other tools give a cause and a remedy, and nothing in them is run."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from calibration_samples import CAMERAS, easymocap, freemocap, opencv_sample, qualisys, yaml_matrix

from studio.footage.capture.calibration_files import read_calibration
from studio.foundations.errors import CalibrationError


def spoiled(path: Path, old: str, new: str) -> Path:
    text = path.read_bytes().decode()
    assert old in text
    path.write_bytes(text.replace(old, new, 1).encode())
    return path


def without(path: Path, name: str) -> Path:
    (path.parent / name).unlink()
    return path


ENTITY = '<!DOCTYPE c [<!ENTITY e SYSTEM "file:///etc/hostname">]>'
BROKEN: dict[str, tuple[Callable[[Path], Path], str]] = {
    "no yaml": (lambda folder: spoiled(easymocap(folder), "%YAML:1.0", "hello"), "is not a file that OpenCV"),
    "cut yaml": (lambda folder: spoiled(easymocap(folder), "data: [", "data: [[[ "), "intri.yml"),
    "extri alone": (lambda folder: without(easymocap(folder), "intri.yml").with_name("extri.yml"), "lies without"),
    "three distortions": (
        lambda folder: spoiled(easymocap(folder), "cols: 5", "cols: 3"), "(intri.yml|distortions)"),
    "strange camera": (
        lambda folder: spoiled(easymocap(folder).with_name("extri.yml"), "T_02", "T_99"), "does not have|T_02"),
    "mirrored": (lambda folder: mirrored(easymocap(folder)), "mirrors the world"),
    "contradiction": (lambda folder: contradicting(easymocap(folder)), "disagree"),
    "sheared": (lambda folder: qualisys(folder / "c.qca.txt", r11="1.7"), "is no rotation"),
    "focal length": (lambda folder: qualisys(folder / "c.qca.txt", focalLengthU="118.0"), "focal lengths of 1.84"),
    "torn": (lambda folder: qualisys(folder / "c.qca.txt", radialDistortion1="-46"), "tear the picture apart"),
    "far centre": (lambda folder: qualisys(folder / "c.qca.txt", centerPointU="64000"), "far outside 128x96"),
    "a word": (lambda folder: qualisys(folder / "c.qca.txt", x="left"), "'transform' x is 'left', no number"),
    "not finite": (lambda folder: qualisys(folder / "c.qca.txt", y="nan"), "no number"),
    "entity": (lambda folder: qualisys(folder / "c.qca.txt", head=ENTITY), "document type or entities"),
    "cut xml": (lambda folder: spoiled(qualisys(folder / "c.qca.txt"), "</cameras>", ""), "is not XML"),
    "no cameras": (lambda folder: written(folder / "c.qca.txt", "<calibration/>"), "no calibrated camera"),
    "pickle": (
        lambda folder: written(folder / "cameraIntrinsicsExtrinsics.pickle", ""),
        "is not OpenCap's pickle of a camera",
    ),
    "no matrix": (lambda folder: written(folder / "c.yml", "%YAML:1.0\n---\na: 1\n"), "holds no camera matrix"),
    "vicon": (lambda folder: written(folder / "c.xcp", "<a/>"), "no calibration format"),
    "fisheye": (
        lambda folder: opencv_sample(folder / "c.yml", CAMERAS[0], fisheye_model=np.ones((1, 1))), "fisheye"),
}  # fmt: skip


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


def mirrored(intri: Path) -> Path:
    camera = CAMERAS[1]
    flip = np.diag([1.0, 1.0, -1.0]) @ camera.rotation
    old, new = (yaml_matrix("Rot_01", matrix, "\r\n") for matrix in (camera.rotation, flip))
    spoiled(intri.with_name("extri.yml"), old, new)
    return intri


def contradicting(intri: Path) -> Path:
    old, new = (yaml_matrix("Rot_01", CAMERAS[k].rotation, "\r\n") for k in (1, 2))
    spoiled(intri.with_name("extri.yml"), old, new)
    return intri


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_gives_a_cause_and_a_remedy(tmp_path: Path, name: str) -> None:
    make, message = BROKEN[name]
    with pytest.raises(CalibrationError, match=message) as caught:
        read_calibration(make(tmp_path))
    assert caught.value.hint.endswith(".")
    assert caught.value.message.count(". ") == 0


def damaged(content: bytes, rng: np.random.Generator) -> bytes:
    """Some bytes changed, removed or put in."""
    out = bytearray(content)
    for _ in range(int(rng.integers(1, 6))):
        place, kind = int(rng.integers(len(out))), int(rng.integers(3))
        if kind == 0:
            out[place] = int(rng.integers(256))
        elif kind == 1:
            del out[place : place + int(rng.integers(1, 30))]
        else:
            out[place:place] = bytes(rng.choice(list(b'0123456789.-e[]:<>"nan'), size=5).astype(np.uint8))
    return bytes(out)


@pytest.mark.parametrize("name", ["easymocap", "qualisys", "yaml", "xml", "toml"])
def test_damaged_files_are_read_or_refused_in_words(tmp_path: Path, name: str) -> None:
    place = {"R": CAMERAS[0].rotation, "T": CAMERAS[0].translation[:, None]}
    path = {
        "easymocap": lambda: easymocap(tmp_path),
        "qualisys": lambda: qualisys(tmp_path / "c.qca.txt"),
        "yaml": lambda: opencv_sample(tmp_path / "c.yml", CAMERAS[0], **place),
        "xml": lambda: opencv_sample(tmp_path / "c.xml", CAMERAS[0], **place),
        "toml": lambda: freemocap(tmp_path),
    }[name]()
    rng, content = np.random.default_rng(11), path.read_bytes()
    refusals: list[str] = []
    for _ in range(80):
        path.write_bytes(damaged(content, rng))
        try:
            assert all(np.isfinite(camera.translation).all() for camera in read_calibration(path).cameras)
        except CalibrationError as refusal:
            refusals.append(refusal.hint)
    assert len(refusals) > 20
    assert all(refusals)
