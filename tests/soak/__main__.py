"""`python -m soak`: the figures."""

import argparse
import sys
import tempfile
from pathlib import Path

from soak.load import LONG, Load, soak, table
from soak.viewers import LEAST, speeds

parser = argparse.ArgumentParser(prog="soak", description=__doc__)
parser.add_argument(
    "--scale", type=int, default=10, help="one of so many frames of the eight hours is stored"
)
parser.add_argument("--scrubs", type=int, default=LONG.scrubs, help="frames looked at")
parser.add_argument("--runs", type=int, default=LONG.runs, help="runs of a session")

if __name__ == "__main__":
    asked = parser.parse_args()
    load = Load(
        hours_frames=LONG.hours_frames // asked.scale,
        scrubs=asked.scrubs,
        runs=asked.runs,
        store_bytes=LONG.store_bytes,
        pings=LONG.pings,
    )
    with tempfile.TemporaryDirectory() as folder:
        found = soak(Path(folder) / "load", load)
        beside = speeds(Path(folder) / "viewers", frames=60, rounds=2)
    found.lines.append(("tracking", beside.in_words()))
    if beside.share < LEAST:
        found.wrong.append(f"viewers leave a run {beside.share:.2f} of its speed, less than {LEAST}")
    print(table(found))
    sys.exit(bool(found.wrong))
