"""The command line as tests call it, in their own process.

Words that need no quotes stand in one text, what comes after it is taken as it is: `call("export toy --to", path)`.
"""

import json

from click.testing import CliRunner, Result

from studio.cli.main import main


def call(line: str, *words: object, code: int = 0) -> Result:
    """`studio LINE WORDS`, which ends with this code."""
    ended = CliRunner().invoke(main, [*line.split(), *map(str, words)], catch_exceptions=False)
    assert ended.exit_code == code, ended.output
    return ended


def answer_of(line: str, *words: object) -> dict:
    """What `studio LINE WORDS --json` prints."""
    return json.loads(call(line, *words, "--json").stdout)


def refusal_of(line: str, *words: object) -> str:
    """What `studio LINE WORDS` says why it does nothing: all on one line, no traceback, nothing for who reads its
    output.
    """
    ended = call(line, *words, code=2)
    assert ended.stdout == ""
    assert "Traceback" not in ended.stderr
    return " ".join(ended.stderr.split())
