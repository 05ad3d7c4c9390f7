"""Archives are unpacked without being believed."""

import io
import tarfile
import zipfile
from pathlib import Path

import pytest

from studio.foundations.errors import StudioError
from studio.sessions.archives import ArchiveError, ArchiveLimits, folder_of, unpack, unpacked, unwrapped


def packed(path: Path, *entries: tuple[str, bytes]) -> Path:
    """A zip with these names and contents."""
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in entries:
            archive.writestr(name, content)
    return path


def tarred(path: Path, *entries: tuple[str, bytes]) -> Path:
    """A tar with these names and contents, pressed as its name says."""
    mode = {".gz": "w:gz", ".tgz": "w:gz", ".bz2": "w:bz2", ".xz": "w:xz"}.get(path.suffix, "w")
    with tarfile.open(path, mode) as archive:  # pyright: ignore[reportCallIssue, reportArgumentType]
        for name, content in entries:
            member = tarfile.TarInfo(name)
            member.size = len(content)
            member.type = tarfile.DIRTYPE if name.endswith("/") else tarfile.REGTYPE
            archive.addfile(member, io.BytesIO(content))
    return path


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Where to unpack."""
    made = tmp_path / "unpacked"
    made.mkdir()
    return made


def written(folder: Path) -> list[str]:
    """All files under a folder."""
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())


def test_a_good_zip_comes_out_byte_for_byte(tmp_path: Path, folder: Path) -> None:
    archive = packed(tmp_path / "a.zip", ("take/", b""), ("take/videos/a.mp4", b"12345"), ("take/b.txt", b""))
    assert unpack(archive, folder) == 5
    assert (folder / "take/videos/a.mp4").read_bytes() == b"12345"
    assert written(folder) == ["take/b.txt", "take/videos/a.mp4"]


@pytest.mark.parametrize("name", ["../out", "/abs", "a/../../out", "a\\..\\out", "C:out", "con"])
def test_names_that_lead_out_are_refused_before_anything_is_written(
    tmp_path: Path, folder: Path, name: str
) -> None:
    archive = packed(tmp_path / "a.zip", ("fine.txt", b"1"), ("placeholder", b"2"))
    # zipfile would clean the name while writing, so it is put into the file afterwards.
    archive.write_bytes(archive.read_bytes().replace(b"placeholder", name.encode().ljust(11, b"_")[:11]))
    if name == "con":
        archive = packed(tmp_path / "b.zip", ("fine.txt", b"1"), (name, b"2"))
    with pytest.raises(StudioError):
        unpack(archive, folder)
    assert written(folder) == []


def test_links_are_refused(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w") as archive:
        entry = zipfile.ZipInfo("link")
        entry.external_attr = 0o120777 << 16
        archive.writestr(entry, "/etc/passwd")
    with pytest.raises(ArchiveError, match="link"):
        unpack(path, folder)


def test_a_bomb_is_stopped_by_the_bytes_that_come_out(tmp_path: Path, folder: Path) -> None:
    archive = packed(tmp_path / "a.zip", ("zeros", bytes(30_000_000)))
    assert archive.stat().st_size < 60_000
    limits = ArchiveLimits(ratio=50.0, free=1_000_000)
    with pytest.raises(ArchiveError, match="more than is allowed"):
        unpack(archive, folder, limits)
    assert sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()) <= 50 * 60_000 + (1 << 20)


def test_sizes_claimed_in_the_index_do_not_help_a_bomb(tmp_path: Path, folder: Path) -> None:
    """The index says that the entry has 10 bytes; the data are far more."""
    archive = packed(tmp_path / "a.zip", ("zeros", bytes(3_000_000)))
    content = bytearray(archive.read_bytes())
    for place in (content.find(b"PK\x01\x02") + 24, content.find(b"PK\x03\x04") + 22):
        content[place : place + 4] = (10).to_bytes(4, "little")
    archive.write_bytes(content)
    with pytest.raises(ArchiveError):
        unpack(archive, folder, ArchiveLimits(total=1_000_000))


@pytest.mark.parametrize("limits", [ArchiveLimits(entries=1), ArchiveLimits(total=3)])
def test_limits_of_count_and_total(tmp_path: Path, folder: Path, limits: ArchiveLimits) -> None:
    archive = packed(tmp_path / "a.zip", ("a", b"12"), ("b", b"34"))
    with pytest.raises(ArchiveError):
        unpack(archive, folder, limits)


def test_the_same_name_twice_is_refused(tmp_path: Path, folder: Path) -> None:
    path = tmp_path / "a.zip"
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("a", "1")
        archive.writestr("A", "2")
    with pytest.raises(ArchiveError, match="twice"):
        unpack(path, folder)


@pytest.mark.parametrize("content", [b"", b"no zip", b"PK\x03\x04" + bytes(40)])
def test_what_is_no_zip_is_named_so(tmp_path: Path, folder: Path, content: bytes) -> None:
    path = tmp_path / "a.zip"
    path.write_bytes(content)
    with pytest.raises(ArchiveError, match=r"a\.zip"):
        unpack(path, folder)


def test_a_zip_cut_short_is_refused(tmp_path: Path, folder: Path) -> None:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        archive.writestr("a", bytes(range(256)) * 50)
    path = tmp_path / "a.zip"
    path.write_bytes(stream.getvalue()[:-200])
    with pytest.raises(ArchiveError):
        unpack(path, folder)


def test_an_upload_of_one_zip_is_what_the_zip_holds(folder: Path) -> None:
    """Also when it is asked for again; whatever the systems that packed it left beside it."""
    packed(folder / "take.zip", ("take/videos/a.mp4", b"12345"), ("__MACOSX/x", b""), (".DS_Store", b""))
    for _ in range(2):
        found = unwrapped(unpacked(folder), ("videos",))
        assert found.name == "take"
        assert (found / "videos/a.mp4").read_bytes() == b"12345"
    assert not (folder / "take.zip").exists()


def test_an_upload_of_files_is_left_as_it_is(folder: Path) -> None:
    packed(folder / "a.zip", ("a.txt", b"1"))
    (folder / "b.txt").write_text("2")
    assert unpacked(folder) == folder
    assert written(folder) == ["a.zip", "b.txt"]


def test_a_zip_that_is_refused_leaves_nothing_but_itself(folder: Path) -> None:
    (folder / "a.zip").write_bytes(b"no zip at all")
    for _ in range(2):
        with pytest.raises(ArchiveError):
            unpacked(folder)
        assert written(folder) == ["a.zip"]


def test_a_folder_that_is_a_part_is_no_wrapping(folder: Path) -> None:
    place = folder / "outer" / "Intrinsics_1" / "cam1"
    place.mkdir(parents=True)
    (place / "a.mp4").write_text("1")
    assert unwrapped(folder, ("intrinsic*",)) == folder / "outer"
    assert unwrapped(folder, ("cam",)) == place


@pytest.mark.parametrize("name", ["a.tar", "a.tar.gz", "a.tgz", "a.tar.bz2", "a.tar.xz"])
def test_a_good_tar_comes_out_byte_for_byte(tmp_path: Path, folder: Path, name: str) -> None:
    """As `tar czf a.tar.gz .` writes it, with a dot before every name."""
    entries = (("./", b""), ("./take/", b""), ("./take/videos/a.mp4", b"12345"), ("./take/b.txt", b""))
    assert unpack(tarred(tmp_path / name, *entries), folder) == 5
    assert (folder / "take/videos/a.mp4").read_bytes() == b"12345"
    assert written(folder) == ["take/b.txt", "take/videos/a.mp4"]


@pytest.mark.parametrize("name", ["../out", "/abs", "a/../../out", "a\\out", "con"])
def test_names_in_a_tar_that_lead_out_are_refused(tmp_path: Path, folder: Path, name: str) -> None:
    with pytest.raises(StudioError):
        unpack(tarred(tmp_path / "a.tar", ("fine.txt", b"1"), (name, b"2")), folder)
    assert written(folder) == []


@pytest.mark.parametrize("kind", [tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.CHRTYPE, tarfile.FIFOTYPE])
def test_links_and_devices_in_a_tar_are_refused(tmp_path: Path, folder: Path, kind: bytes) -> None:
    path = tmp_path / "a.tar"
    with tarfile.open(path, "w") as archive:
        member = tarfile.TarInfo("link")
        member.type, member.linkname = kind, "/etc/passwd"
        archive.addfile(member)
    with pytest.raises(ArchiveError, match="link"):
        unpack(path, folder)
    assert written(folder) == []


def test_a_tar_that_claims_or_holds_too_much_is_refused(tmp_path: Path, folder: Path) -> None:
    path = tarred(tmp_path / "a.tar.gz", ("zeros", bytes(3_000_000)))
    for limits in (ArchiveLimits(total=1_000_000), ArchiveLimits(ratio=10.0, free=1_000)):
        with pytest.raises(ArchiveError, match="more than is allowed"):
            unpack(path, folder, limits)
        (folder / "zeros").unlink(missing_ok=True)


@pytest.mark.parametrize("name", ["a.tar", "a.tar.gz", "a.tar.bz2", "a.tar.xz"])
def test_a_tar_that_is_none_or_is_cut_short_is_named(tmp_path: Path, folder: Path, name: str) -> None:
    whole = tarred(tmp_path / name, ("a", bytes(range(256)) * 500)).read_bytes()
    for content in (b"", b"no tar", whole[: len(whole) // 2]):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ArchiveError, match="can be unpacked"):
            unpack(tmp_path / name, folder)
        (folder / "a").unlink(missing_ok=True)


def test_an_archive_is_a_folder_for_as_long_as_it_is_in_use(tmp_path: Path) -> None:
    source = tarred(tmp_path / "take.tar.gz", ("take/videos/a.mp4", b"12345"))
    with folder_of(source, ("videos",), tmp_path / "sessions" / "new") as folder:
        assert (folder / "videos/a.mp4").read_bytes() == b"12345"
        assert folder.is_relative_to(tmp_path / "sessions")
    assert not list((tmp_path / "sessions").iterdir())
    assert source.exists()
    with folder_of(tmp_path, (), tmp_path / "new") as folder:
        assert folder == tmp_path
