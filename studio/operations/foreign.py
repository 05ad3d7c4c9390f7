"""What came from others, before it is used."""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from studio.foundations.declaring import Terminal, operation
from studio.sessions.foreign_sessions import Inspection, inspect_place
from studio.sessions.names import is_name
from studio.sessions.workspace import Workspace


@operation
def inspect(
    place: Annotated[
        str | Path,
        Field(description="A session's folder or name, a folder of footage, or an archive of one."),
        Terminal(kind=str, metavar="FOLDER"),
    ],
) -> Inspection:
    """Say what is odd about a session or footage of other people before it is opened or imported.

    It names links that lead out of the folder, pipes and devices, files larger than what is read, records and stores
    that cannot be right, and footage that lies elsewhere. Nothing is changed or unpacked. The command ends with 1 where
    the source should not be used.

    Raises NotFoundError where nothing lies at the place.
    """
    path = Path(place).expanduser()
    named = Workspace().root / str(place)
    return inspect_place(named if is_name(str(place)) and not path.exists() and named.is_dir() else path)
