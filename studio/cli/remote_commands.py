"""Sessions on many machines: `batch`, `upload`, `download`."""

from dataclasses import asdict

from studio.cli.deriving import Call, command_of
from studio.cli.output import EXIT_CODE
from studio.cli.reading import frame_range
from studio.cli.tracking_commands import FRAMES
from studio.operations.remote import Batch, BatchLine, batch, download, upload
from studio.sessions.session import Session


@command_of(batch, FRAMES, without=("first", "last"))
def batch_command(call: Call, frames: str) -> dict[str, object]:
    first, last = frame_range(frames)
    done: Batch = call(first=first, last=last)
    failed = [line for line in done.lines if line.run is None]
    lines = [_in_words(line) for line in done.lines]
    if failed:
        lines.append(f"{len(failed)} of {len(done.lines)} sessions could not be tracked.")
    sessions = [asdict(line) for line in done.lines]
    return {"sessions": sessions, "text": "\n".join(lines), EXIT_CODE: 1 if failed else 0}


def _in_words(line: BatchLine) -> str:
    run = line.run
    if run is None:
        return f"{line.session:24} {line.failure}"
    error = "" if run.error is None else f"  {run.error:.1f} mm off"
    overlap = "" if run.overlap is None else f"  {100 * run.overlap:.1f} % in the masks"
    return f"{line.session:24} {run.run:16} {len(run.frames):>6} frames{error}{overlap}  {run.milliseconds:.0f} ms each"


@command_of(upload)
def upload_command(call: Call) -> dict[str, object]:
    address: str = call()
    return {"address": address, "text": f"The session is at {address}"}


@command_of(download)
def download_command(call: Call) -> dict[str, object]:
    session: Session = call()
    return {"session": str(session.path), "text": f"Session {session.name} in {session.path}"}
