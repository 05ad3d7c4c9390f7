"""`python -m hostile`: the table."""

import argparse
import sys

from hostile.campaign import HEAD, campaign, line
from hostile.makers import MAKERS

parser = argparse.ArgumentParser(prog="hostile", description=__doc__)
parser.add_argument("--only", action="append", metavar="SESSION", help="of these names alone")
parser.add_argument("--few", action="store_true", help="of requests and commands a part for each session")
parser.add_argument("--seconds", type=float, help="begin no session after so long")

if __name__ == "__main__":
    asked = parser.parse_args()
    print(HEAD)
    found = campaign(
        asked.only or list(MAKERS),
        asked.seconds,
        few=asked.few,
        told=lambda name, tally: print(line(name, tally), flush=True),
    )
    print(
        f"{len(found) - 1} of {len(MAKERS)} sessions, {sum(len(one.wrong) for one in found.values())} wrong"
    )
    sys.exit(any(tally.wrong for tally in found.values()))
