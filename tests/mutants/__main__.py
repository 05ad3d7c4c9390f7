"""`python -m mutants`: the table."""

import argparse
import time
from pathlib import Path

from mutants.campaign import Campaign, table
from mutants.rooms import ROOMS, Room

ROOT = Path(__file__).resolve().parents[2]

parser = argparse.ArgumentParser(prog="mutants", description=__doc__)
parser.add_argument("rooms", nargs="*", default=ROOMS, metavar="ROOM", help=", ".join(ROOMS))
parser.add_argument("--count", type=int, default=20, help="changes of each room")
parser.add_argument("--seed", type=int, default=0)
parser.add_argument("--seconds", type=float, default=float("inf"), help="begin none after so long")
parser.add_argument("--again", action="store_true", help="try once more what survived")
parser.add_argument("--whole", action="store_true", help="with all tests of the room that reach a change")

if __name__ == "__main__":
    asked = parser.parse_args()
    folder = ROOT / "build" / "mutants"
    folder.mkdir(parents=True, exist_ok=True)
    campaign = Campaign(ROOT, folder)
    until = time.monotonic() + asked.seconds
    tallies = {
        name: campaign.run(
            Room(ROOT, name), asked.count, asked.seed, until, again=asked.again, whole=asked.whole
        )
        for name in asked.rooms
    }
    print(table(tallies))
