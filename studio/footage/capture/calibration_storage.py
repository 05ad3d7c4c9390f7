"""OpenCV's own calibration files, YAML and XML, read in Python.

OpenCV's parser is not used. It trusts what it reads: a matrix without its `cols` writes past its memory, deep nesting
overflows its stack (both end the process), and damaged base64 keeps it busy for ever (seen with 5.0). Of the format
only what calibrations are made of is read: numbers, texts, lists of them, and matrices (`rows`, `cols`, `dt`, `data`),
whose parts are checked before they become an array. Every step takes time in proportion to the file's length.
"""

import re
import xml.parsers.expat
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, TreeBuilder

import numpy as np

from studio.foundations.arrays import Array
from studio.foundations.errors import CalibrationError
from studio.foundations.foreign_files import read_foreign_text

# A scalar as it is written, a list of scalars, or a map of these. What is nested deeper is kept as an empty map.
Entry = str | list[str] | dict[str, "Entry"]

STORAGE_SUFFIXES = frozenset((".yml", ".yaml", ".xml"))
LARGEST_FILE = 10_000_000
DEEPEST_XML = 20

LONGEST_NUMBER = 400
NUMBER = re.compile(
    r"[-+]?(?:(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:e[-+]?[0-9]+)?|\.(?:inf|nan))", re.IGNORECASE
)
NUMBER_TYPE = re.compile(r"(\d{0,3})([a-zA-Z])")
KEY = re.compile(r"""("[^"]*"\s*|'[^']*'\s*|[^\s"'\[\]{},#&*!|>%@:-][^:\[\]{}"']*):\s*(.*)""")
TAG = re.compile(r"!(?:<[^>]*>|\S*)\s*")
QUOTED = re.compile(r'"(?:[^"\\]|\\.)*"|\'(?:[^\']|\'\')*\'')


class Storage:
    """The entries of one file by name. Raises CalibrationError if it is not of OpenCV's making."""

    def __init__(self, path: Path) -> None:
        self.where = f"'{path.name}'"
        text = storage_text(path)
        if text is None:
            raise CalibrationError(f"{self.where} cannot be read as text.", "Copy or export it again.")
        text = text.lstrip()
        try:
            self._entries = _xml_entries(path, text) if text.startswith("<?xml") else _yaml_entries(text)
        except ValueError as problem:
            raise CalibrationError(
                f"{self.where} is not a file that OpenCV's FileStorage wrote ({problem}).",
                "Export it again; YAML begins with '%YAML:1.0'.",
            ) from None
        self.names = tuple(self._entries)

    def first(self, *names: str) -> str:
        """The first of these names that the file has, "" if none."""
        return next((name for name in names if name in self._entries), "")

    def numbers(self, name: str) -> Array:
        """An entry as an array: a matrix, a list of numbers, or one number. Raises CalibrationError."""
        entry = self._entries.get(name, {})
        if isinstance(entry, dict) and {"rows", "cols", "dt", "data"} & set(entry):
            values = self._matrix(name, entry)
        else:
            content = _numbers(entry)
            if content is None:
                raise CalibrationError(f"{self.where} has no numbers in '{name}'.", "Export the file again.")
            values = content if isinstance(entry, list) else content.reshape(())
        if not np.all(np.isfinite(values)):
            raise CalibrationError(
                f"{self.where}: '{name}' holds a number that is not finite.", "Calibrate again."
            )
        return values

    def shaped(self, name: str, *shape: int) -> Array:
        """An entry of so many numbers as an array of that shape. Raises CalibrationError."""
        values = self.numbers(name)
        if values.size != int(np.prod(shape)):
            raise CalibrationError(
                f"{self.where}: '{name}' has {values.size} numbers, not {int(np.prod(shape))}.",
                "Export it again.",
            )
        return values.reshape(shape)

    def text(self, name: str) -> str:
        """An entry's text, "" if it is missing or no text."""
        entry = self._entries.get(name, "")
        return _unquoted(entry) if isinstance(entry, str) and not _is_number(entry) else ""

    def _matrix(self, name: str, entry: dict[str, Entry]) -> Array:
        """(rows, cols) or (rows, cols, channels). Raises CalibrationError naming the part that is missing or wrong."""
        for part in ("rows", "cols", "dt", "data"):
            if part not in entry:
                raise CalibrationError(
                    f"{self.where}: the matrix '{name}' has no '{part}'.", "Export the file again."
                )
        sides = [self._side(name, part, entry[part]) for part in ("rows", "cols")]
        kind = NUMBER_TYPE.fullmatch(_unquoted(entry["dt"])) if isinstance(entry["dt"], str) else None
        if kind is None:
            raise CalibrationError(
                f"{self.where}: 'dt' of the matrix '{name}' is no type of numbers.",
                "It is 'd' for a calibration: export the file again.",
            )
        values = _numbers(entry["data"])
        if values is None:
            raise CalibrationError(
                f"{self.where}: 'data' of the matrix '{name}' is no list of numbers.",
                "Export the file again, as text and not in base64.",
            )
        shape = (*sides, int(kind[1])) if kind[1] not in ("", "1") else tuple(sides)
        if values.size != int(np.prod(shape)):
            raise CalibrationError(
                f"{self.where}: the matrix '{name}' is {'x'.join(map(str, shape))} but has {values.size} numbers.",
                "Export the file again.",
            )
        return values.reshape(shape)

    def _side(self, name: str, part: str, entry: Entry) -> int:
        if not isinstance(entry, str) or not re.fullmatch(r"[0-9]{1,6}", entry) or int(entry) < 1:
            raise CalibrationError(
                f"{self.where}: '{part}' of the matrix '{name}' is no whole number above 0.",
                "Export the file again.",
            )
        return int(entry)


def storage_text(path: Path) -> str | None:
    """The file's text, None where it is none, too large, or not readable."""
    try:
        if not path.is_file() or path.stat().st_size > LARGEST_FILE:
            return None
        return read_foreign_text(path)
    except (OSError, UnicodeDecodeError):
        return None


def xml_root(path: Path, text: str, remedy: str) -> Element:
    """The tree of an XML text; document types and entities are refused, nothing is fetched. Raises CalibrationError."""
    where = f"'{path.name}'"
    builder, parser = TreeBuilder(), xml.parsers.expat.ParserCreate()
    depth = 0

    def refuse(*_: object) -> int:
        raise CalibrationError(
            f"{where} declares a document type or entities, which no calibration needs.", remedy
        )

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST_XML:
            raise CalibrationError(f"{where} is nested deeper than any calibration.", remedy)
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    parser.ExternalEntityRefHandler = refuse
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(text.encode(), True)
        return builder.close()
    except (xml.parsers.expat.ExpatError, ParseError, AssertionError) as problem:
        raise CalibrationError(f"{where} is not XML: {problem}.", remedy) from None


def _numbers(entry: Entry) -> Array | None:
    """(N,) the numbers of a scalar or a list; None where there is anything else."""
    words = [entry] if isinstance(entry, str) else entry
    if isinstance(words, dict) or not all(_is_number(word) for word in words):
        return None
    # YAML's ".inf" and ".nan" are Python's without the point.
    return np.array([float(re.sub(r"\.(?=[in])", "", word.lower())) for word in words], dtype=np.float64)


def _is_number(word: str) -> bool:
    return len(word) <= LONGEST_NUMBER and NUMBER.fullmatch(word) is not None


def _unquoted(word: str) -> str:
    """A scalar's text without quotes and escapes."""
    if len(word) < 2 or word[0] != word[-1] or word[0] not in "\"'":
        return word
    return word[1:-1].replace("''", "'") if word[0] == "'" else re.sub(r"\\(.)", r"\1", word[1:-1])


# ---------------------------------------------------------------------- XML


def _xml_entries(path: Path, text: str) -> dict[str, Entry]:
    """The entries below `opencv_storage`. Raises ValueError, CalibrationError."""
    root = xml_root(path, text, "Export it again.")
    if root.tag != "opencv_storage":
        raise ValueError(f"its outermost tag is <{root.tag[:40]}>")
    return _children(root, 0)


def _children(element: Element, depth: int) -> dict[str, Entry]:
    """What lies in a tag, by name. Raises ValueError for a name given twice."""
    entries: dict[str, Entry] = {}
    for child in element:
        if child.tag in entries:
            raise ValueError(f"'{child.tag[:40]}' appears twice")
        if not len(child):
            entries[child.tag] = _xml_words(child.text or "")
        elif all(entry.tag == "_" and not len(entry) for entry in child):
            entries[child.tag] = [(entry.text or "").strip() for entry in child]
        else:
            entries[child.tag] = _children(child, depth + 1) if depth == 0 else {}
    return entries


def _xml_words(text: str) -> Entry:
    """A tag's text: one scalar, or a list where it holds several words."""
    text = text.strip()
    if text[:1] == text[-1:] == '"':
        return text
    words = text.split()
    return words[0] if len(words) == 1 else words


# ---------------------------------------------------------------------- YAML


def _yaml_entries(text: str) -> dict[str, Entry]:
    """The first document's entries. Raises ValueError saying what is wrong where."""
    lines = text.splitlines()
    if not lines or not lines[0].startswith("%YAML"):
        raise ValueError("it begins with neither '%YAML' nor '<?xml'")
    return _block(_logical_lines(lines), 0)


Line = tuple[int, int, str]
"""Its number from 1, how far it is indented, and its text without comment; brackets that it opens are closed."""


def _logical_lines(lines: list[str]) -> list[Line]:
    """The lines of the first document; a list that goes over several is one line."""
    logical: list[Line] = []
    opened, parts, begun = 0, list[str](), (0, 0)
    for number, raw in enumerate(lines[1:], 2):
        if not opened and raw.startswith(("---", "...")):
            if logical:
                break
            continue
        text, change = _without_comment(raw, number)
        if not text.strip():
            continue
        if not opened:
            begun = (number, len(text) - len(text.lstrip()))
        parts.append(text.strip())
        opened += change
        if opened < 0:
            raise ValueError(f"line {number} closes a bracket that is not open")
        if not opened:
            logical.append((*begun, " ".join(parts)))
            parts = []
    if opened:
        raise ValueError(f"the list of line {begun[0]} is not closed")
    return logical


def _without_comment(line: str, number: int) -> tuple[str, int]:
    """A line without its comment, and how many more brackets it opens than closes. Raises ValueError."""
    change, at = 0, 0
    while at < len(line):
        sign, before = line[at], line[at - 1] if at else " "
        if sign in "\"'" and (before.isspace() or before in "[{,:"):
            quoted = QUOTED.match(line, at)
            if quoted is None:
                raise ValueError(f"a quotation mark of line {number} is not closed")
            at = quoted.end()
            continue
        if sign == "#" and before.isspace():
            return line[:at], change
        change += (sign in "[{") - (sign in "]}")
        at += 1
    return line, change


def _block(lines: list[Line], depth: int) -> dict[str, Entry]:
    """The entries of a map whose lines these are; maps in its maps' maps are left empty. Raises ValueError."""
    entries: dict[str, Entry] = {}
    at = 0
    while at < len(lines):
        number, indent, text = lines[at]
        key = KEY.fullmatch(text)
        if key is None or indent != lines[0][1]:
            raise ValueError(f"line {number} is no entry")
        name, value = _unquoted(key[1].strip()), TAG.sub("", key[2], count=1) if key[2][:1] == "!" else key[2]
        if name in entries:
            raise ValueError(f"line {number} gives '{name[:40]}' a second time")
        at += 1
        inner = at
        while at < len(lines) and (lines[at][1] > indent or (lines[at][1] == indent and _item(lines[at][2]))):
            at += 1
        entries[name] = _value(value, lines[inner:at], depth)
    return entries


def _item(text: str) -> bool:
    return text == "-" or text.startswith("- ")


def _value(value: str, below: list[Line], depth: int) -> Entry:
    """What stands behind a key: on its line, or on the lines below it. Raises ValueError."""
    if value.startswith("[") and not below:
        return _flow(value)
    if value or not below:
        # A text of several lines, or a map in braces: nothing that a calibration needs.
        return {} if below or value.startswith("{") else value
    if all(_item(text) and indent == below[0][1] for _, indent, text in below):
        return [text[1:].strip() for _, _, text in below]
    if depth or _item(below[0][2]):
        return {}
    return _block(below, depth + 1)


def _flow(value: str) -> Entry:
    """A list in brackets; one with lists or maps in it is left empty. Raises ValueError where it does not end."""
    if not value.endswith("]"):
        raise ValueError(f"'{value[:40]}' is no list")
    inner = value[1:-1].strip()
    if any(sign in inner for sign in "[]{}\"'"):
        return {}
    return [word.strip() for word in inner.removesuffix(",").split(",")] if inner else []
