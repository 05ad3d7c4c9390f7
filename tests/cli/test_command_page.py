"""The guide's page of commands is what the commands say today."""

from pathlib import Path

from studio.cli.command_page import command_page
from studio.cli.main import COMMANDS

PAGE = Path(__file__).parents[2] / "web_assets" / "guide" / "commands.md"


def test_the_page_is_up_to_date_and_has_every_command() -> None:
    page = command_page()
    assert PAGE.read_text(encoding="utf-8") == page, "run `make guide`"
    assert all(f"\n## {name}\n" in page for name in COMMANDS)
    assert "| `--seed INTEGER" in page
