"""Tables of points of other programs, made the studio's own: a header of frame and columns, then rows.

    DeepLabCut, Anipose's DLC form   rows scorer, (individuals), bodyparts, coords, then a row a frame
    Motive                           "Format Version,…", then rows Type, Name, ID, (Parent), Position, and Frame,
    Time, X, Y, Z Vicon Nexus                      "Trajectories", the rate, names, Frame, Sub Frame, X, Y, Z, units
    Qualisys                         NO_OF_FRAMES, … MARKER_NAMES, rows of X Y Z

Coordinates stay in the file's own axes: a table is laid on the session by its cameras or by alignment.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from studio.foundations.errors import TruthError

Rows = Sequence[Sequence[str]]
AXES = ("x", "y", "z")
UNITS = {
    "millimeters": "mm",
    "millimetres": "mm",
    "centimeters": "cm",
    "centimetres": "cm",
    "meters": "m",
    "metres": "m",
}
MARKER_TYPES = ("marker", "bone marker", "rigid body marker", "labeled marker")


def own_form(path: Path, rows: Rows) -> Rows:
    """The rows with a header in the studio's form; unchanged where they are of no known program. Raises TruthError."""
    first = next((row for row in rows if any(row)), None)
    if first is None:
        return rows
    key = first[0].lower().strip("\ufeff")
    reader = next((candidate for start, candidate in PROGRAMS.items() if key.startswith(start)), None)
    return rows if reader is None else reader(path, [list(row) for row in rows if any(row)])


def _deeplabcut(path: Path, rows: list[list[str]]) -> Rows:
    heads: dict[str, list[str]] = {}
    while rows and rows[0][0].lower() in ("scorer", "individuals", "bodyparts", "coords"):
        head = rows.pop(0)
        heads[head[0].lower()] = head
    if not {"bodyparts", "coords"} <= set(heads):
        raise TruthError(
            f"'{path.name}' has DeepLabCut's row 'scorer' but not 'bodyparts' and 'coords'.",
            "Export it again.",
        )
    animals = heads.get("individuals", [])
    several = list(dict.fromkeys(animals[1:]))
    if len(several) > 1:
        raise TruthError(
            f"'{path.name}' has points of {len(several)} individuals ({', '.join(several[:4])}).",
            "Export one individual a file: a truth is of one body.",
        )
    header = ["frame"]
    kept = [0]
    for column in range(1, len(heads["bodyparts"])):
        axis = heads["coords"][column].lower()
        if axis in AXES:
            header.append(f"{heads['bodyparts'][column]}_{axis}")
            kept.append(column)
    if "z" not in {name[-1] for name in header[1:]}:
        raise TruthError(
            f"'{path.name}' holds pixels (x, y, likelihood), not places in space.",
            "Give the table after triangulation (…_DLC_3D.csv).",
        )
    return [header, *([row[at] if at < len(row) else "" for at in kept] for row in rows)]


def _motive(path: Path, rows: list[list[str]]) -> Rows:
    start = rows[0]
    entries = {start[at].lower(): start[at + 1] for at in range(0, len(start) - 1, 2)}
    unit = UNITS.get(entries.get("length units", "").lower(), "")
    at = next((number for number, row in enumerate(rows) if row[0].lower() == "frame"), -1)
    named = [row for row in rows[:at] if len(row) > 2 and "name" in (row[0].lower(), row[1].lower())]
    kinds = [row for row in rows[:at] if len(row) > 2 and "type" in (row[0].lower(), row[1].lower())]
    whats = [row for row in rows[:at] if "Position" in row]
    if at < 0 or not named or not whats:
        raise TruthError(
            f"'{path.name}' is not Motive's table of points.", "Export the take as CSV with its markers."
        )
    names, kind, what = named[0], kinds[0] if kinds else [], whats[-1]
    width = len(rows[at])
    places = [
        column
        for column in range(2, width)
        if column < len(what) and what[column] == "Position" and rows[at][column].lower() in AXES
    ]
    marked = [column for column in places if column < len(kind) and kind[column].lower() in MARKER_TYPES]
    kept = marked or places
    plain = {column: names[column].split(":")[-1] if column < len(names) else "" for column in kept}
    ending = f"_{unit}" if unit else ""
    header = ["frame", *(f"{plain[column]}_{rows[at][column].lower()}{ending}" for column in kept)]
    return [header, *([row[0], *(row[c] if c < len(row) else "" for c in kept)] for row in rows[at + 1 :])]


def _vicon(path: Path, rows: list[list[str]]) -> Rows:
    at = next((number for number, row in enumerate(rows) if row[0].lower() == "frame"), -1)
    if at < 1 or at + 1 >= len(rows):
        raise TruthError(f"'{path.name}' is not Nexus' table of trajectories.", "Export trajectories as CSV.")
    names, axes, units = rows[at - 1], rows[at], rows[at + 1]
    header, kept, name = ["frame"], [0], ""
    for column in range(2, len(axes)):
        if axes[column].lower() not in AXES:
            continue
        own = names[column] if column < len(names) else ""
        name = own.split(":")[-1] or name
        unit = units[column] if column < len(units) and units[column] in ("mm", "cm", "m") else ""
        header.append(f"{name}_{axes[column].lower()}" + (f"_{unit}" if unit else ""))
        kept.append(column)
    body: list[list[str]] = []
    for row in rows[at + 2 :]:
        if not row[0].isdigit():
            # Another kind of data follows.
            break
        body.append([row[c] if c < len(row) else "" for c in kept])
    return [header, *body]


def _qualisys(path: Path, rows: list[list[str]]) -> Rows:
    names: list[str] = []
    for number, row in enumerate(rows):
        if row[0].upper() == "MARKER_NAMES":
            names = [name for name in row[1:] if name]
        elif names and _is_number(next((cell for cell in row if cell), "")):
            body = rows[number:]
            ahead = len(body[0]) - 3 * len(names)
            header = ["frame", *(f"{name}_{axis}_mm" for name in names for axis in AXES)]
            ahead = 2 if ahead >= 2 else 0
            return [header, *([str(at), *row[ahead : ahead + 3 * len(names)]] for at, row in enumerate(body))]
    raise TruthError(
        f"'{path.name}' is not Qualisys' table of markers.", "Export 3D data as TSV with its header."
    )


def _is_number(text: str) -> bool:
    try:
        float(text.replace(",", "."))
    except ValueError:
        return False
    return True


PROGRAMS: Mapping[str, Callable[[Path, list[list[str]]], Rows]] = {
    "scorer": _deeplabcut,
    "format version": _motive,
    "trajectories": _vicon,
    "no_of_frames": _qualisys,
}
"""First cell of the file, lower case → what reads the rest."""
