"""`studio background` says what comes next where masks are of no use."""

from pathlib import Path

import pytest
from command_line import call, refusal_of

from studio.cli.main import main
from studio.cli.mask_commands import _answer
from studio.runs.setup.contrast import Contrast, ViewContrast
from studio.runs.setup.mask_quality import MaskQuality, ViewQuality
from studio.sessions.background_files import SessionEvidence, write_evidence
from studio.sessions.session import Session


def said(session: Session, agreement: float) -> str:
    views = tuple(ViewQuality(name, agreement, agreement, 0.0, ()) for name in ("a", "b"))
    return str(_answer(session, MaskQuality((0,), views, (60.0,)))["text"])


def test_poor_masks_name_the_command_that_tries_every_source(session_on_disk: Session) -> None:
    write_evidence(session_on_disk, SessionEvidence(knobs={"background_model": "gaussian"}))
    assert "studio background toy --source best" in said(session_on_disk, 0.5)
    assert "--source best" not in said(session_on_disk, 0.95)


def test_made_masks_are_not_thrown_away_for_it(session_on_disk: Session) -> None:
    write_evidence(session_on_disk, SessionEvidence(knobs={"background_model": "mask"}))
    assert "--source best" not in said(session_on_disk, 0.5)


def test_the_command_that_is_named_is_one(session_on_disk: Session) -> None:
    help_text = call("background --help").stdout
    assert "best" in help_text
    with pytest.raises(SystemExit):
        main(["background", "no-such-session", "--source", "best"])


def test_plates_that_are_not_there_are_said_to_be_so(session_on_disk: Session, tmp_path: Path) -> None:
    assert "There is no folder '/nosuch'" in refusal_of("background toy --plates /nosuch")
    file = tmp_path / "empty.png"
    file.touch()
    assert f"Write CAMERA={file}" in refusal_of("background toy --plates", file)
    assert "'--plates =x' cannot be understood" in refusal_of("background toy --plates =x")


def test_low_contrast_is_said_with_what_may_help(session_on_disk: Session) -> None:
    views = tuple(ViewQuality(name, 0.95, 0.95, 0.0, (), border=0.9) for name in ("a", "b"))
    alike = tuple(
        ViewContrast(name, 0.2, {"left forearm": 0.6}, 0, (((1, 2), (9, 2), (9, 8)),)) for name in ("a", "b")
    )
    answer = _answer(
        session_on_disk, MaskQuality((0,), views, (60.0,), contrast=Contrast(alike, "told", 0.025))
    )
    assert "Left forearm and background are alike in a and b. Narrow the shadow colour" in str(answer["text"])
    assert "--quality --pictures FOLDER" in str(answer["text"])
    assert answer["usable"] is False
