"""The corpus, some of the mutations that `make fuzz` reads by the thousand, and that harm would be noticed."""

import pytest

from fuzz.campaign import campaign, table
from fuzz.formats import FORMATS
from fuzz.mutations import RULES
from fuzz.reading import CORPUS, Bench

QUIET = ("read", "refused")


def malformed(bench: Bench, name: str) -> dict[str, tuple[str, bytes]]:
    """The corpus of a format, by a name: the file and its content, by each rule, and as they are kept."""
    found = {
        f"{file} {rule}": (file, make(content))
        for file, content in list(bench.files.items())[:3]
        for rule, make in RULES.items()
    }
    kept = sorted((CORPUS / name).glob("*")) if (CORPUS / name).is_dir() else []
    for path in kept:
        alike = [file for file in bench.files if file.endswith(path.suffix)]
        found[path.name] = (alike[0], path.read_bytes())
    return found


LONG = ("mjcf",)
"""Formats whose reader takes seconds a file."""


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in LONG)) for name in FORMATS]
)
def test_the_corpus_is_read_or_refused_in_words(name: str, tmp_path_factory: pytest.TempPathFactory) -> None:
    bench = Bench(name, tmp_path_factory.mktemp("bench"))
    for what, (file, content) in malformed(bench, name).items():
        assert bench.read(file, content) in QUIET, what


def test_the_corpus_is_large_and_knows_every_format() -> None:
    assert len(FORMATS) * len(RULES) >= 200
    assert {path.name for path in CORPUS.iterdir()} <= set(FORMATS)


def test_some_mutations_are_read_or_refused_in_words() -> None:
    found = campaign([*FORMATS], 10 * len(FORMATS))
    assert not any(tally.failures for tally in found.values()), table(found)
    assert sum(tally.read for tally in found.values()) > 50, "mutations that destroy everything test nothing"


@pytest.mark.slow
def test_harm_is_noticed() -> None:
    tally = campaign(["numbers"], 6, module="fuzz.harmful", patience=15.0)["numbers"]
    assert (tally.tries, tally.read, tally.tracebacks, tally.aborts, tally.hangs) == (6, 2, 2, 1, 1)
    assert [number for number, _ in tally.failures] == [1, 2, 3, 4]


@pytest.mark.slow
def test_twenty_thousand_mutations_are_read_or_refused_in_words() -> None:
    found = campaign([*FORMATS], 20_000)
    assert not any(tally.failures for tally in found.values()), table(found)
