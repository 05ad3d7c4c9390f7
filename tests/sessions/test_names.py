"""Names travel in addresses: nothing that leaves the workspace is one."""

from pathlib import Path

import pytest

from studio.foundations.errors import NotFoundError, SessionError
from studio.sessions.names import checked_name, free_name, inside, is_name, name_from

ATTACKS = [
    "", ".", "..", "../x", "a/b", "a\\b", "/etc", "C:\\x", "%2e%2e", "a%2fb", "a\0b", "nul", "CON", "com1",
    "LPT9", "a" * 65, "a b", "a.b", "é", "-\n", "~", "a;b", ".hidden", "a\u202eb", "x\n",
]  # fmt: skip


@pytest.mark.parametrize("name", ATTACKS)
def test_attacks_are_refused(name: str, tmp_path: Path) -> None:
    with pytest.raises(SessionError) as caught:
        inside(tmp_path, name)
    assert caught.value.status == 422
    assert caught.value.hint
    assert not is_name(name)


@pytest.mark.parametrize("name", ["walk", "Lee-walk_2", "a" * 64, "0", "-", "console"])
def test_lawful_names_stay_inside(name: str, tmp_path: Path) -> None:
    assert inside(tmp_path, name) == tmp_path.resolve() / name
    assert checked_name(name) == name


def test_links_out_are_refused_and_links_inside_followed(tmp_path: Path) -> None:
    root, evil = tmp_path / "rec", tmp_path / "rec-evil"
    (root / "real").mkdir(parents=True)
    evil.mkdir()
    (root / "out").symlink_to(evil)
    (root / "up").symlink_to(tmp_path)
    (root / "self").symlink_to(root)
    (root / "in").symlink_to(root / "real")
    for name in ("out", "up", "self"):
        with pytest.raises(NotFoundError, match="leads out"):
            inside(root, name)
    assert inside(root, "in") == (root / "real").resolve()


def test_a_root_that_is_a_link_itself_is_fine(tmp_path: Path) -> None:
    (tmp_path / "real" / "walk").mkdir(parents=True)
    (tmp_path / "link").symlink_to(tmp_path / "real")
    assert inside(tmp_path / "link", "walk").name == "walk"


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("Lee walk", "Lee-walk"), ("../../etc/passwd", "etc-passwd"), ("con", "con-session"), ("", "session"),
        ("Übung 3", "Ubung-3"), ("x" * 90, "x" * 64), ("漢字", "session"),
    ],
)  # fmt: skip
def test_names_from_titles(text: str, name: str) -> None:
    assert name_from(text) == name
    assert is_name(name_from(text))


def test_free_names_count_up_and_ignore_case() -> None:
    assert free_name("walk", set()) == "walk"
    assert free_name("walk", {"Walk", "walk-2"}) == "walk-3"
    assert len(free_name("w" * 64, {"w" * 64})) <= 64
