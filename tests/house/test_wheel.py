"""What `pip install .` gives, outside the checkout: the command, pages, bodies and one sample session."""

import hashlib
import os
import re
import subprocess
import sys
import urllib.request
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The wheel, unpacked into a folder of its own."""
    place = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "pip", "wheel", str(ROOT), "--no-deps", "--no-build-isolation", "--quiet"]
    subprocess.run([*build, "--wheel-dir", str(place)], check=True, capture_output=True)
    (wheel,) = place.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        archive.extractall(place / "unpacked")
    return place / "unpacked"


def environment(installed: Path, workspace: Path) -> dict[str, str]:
    return {
        **os.environ,
        "PYTHONPATH": str(installed),
        "STUDIO_WORKSPACE": str(workspace),
        "PYTHONUNBUFFERED": "1",
    }


def test_bodies_travel(installed: Path, tmp_path: Path) -> None:
    code = "import studio, studio.cli.main as m; print(studio.__file__); m.main(['bodies'])"
    listed = subprocess.run(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment(installed, tmp_path),
        capture_output=True,
        text=True,
    )
    assert str(installed) in listed.stdout
    assert "human31" in listed.stdout


def test_the_arena_s_problems_travel(installed: Path) -> None:
    assert (installed / "studio" / "results" / "arena" / "problems.npz").stat().st_size > 1_000_000


def test_the_network_travels_with_its_licence(installed: Path) -> None:
    models = installed / "studio" / "evidence" / "models"
    readme = (models / "README.md").read_text()
    for network in models.glob("*.tflite"):
        assert hashlib.sha256(network.read_bytes()).hexdigest() in readme
        assert (models / f"{network.stem}-LICENSE").is_file()
        assert f"{network.stem}-LICENSE" in readme


@pytest.mark.slow
def test_the_demo_serves_pages_and_sample(installed: Path, tmp_path: Path) -> None:
    code = "import studio.cli.main as m; m.main(['demo'])"
    with subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=environment(installed, tmp_path),
        stdout=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.stdout is not None
        try:
            address = ""
            for line in process.stdout:
                found = re.search(r"http://127\.0\.0\.1:\d+/\?token=\S+", line)
                if found:
                    address = found.group()
                    break
            opener = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
            assert "Capture studio" in opener.open(address).read().decode()
            base = address.split("/?")[0]
            assert b"--rail-width" in opener.open(f"{base}/assets/page.css").read()
            assert '"walk"' in opener.open(f"{base}/api/sessions").read().decode()
            assert b"survival" in opener.open(f"{base}/guide").read()
        finally:
            process.terminate()
            process.wait(30)
