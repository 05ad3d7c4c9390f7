"""`python -m faults`: the table."""

import argparse
import sys
import tempfile
from pathlib import Path

from faults.campaign import campaign, table
from faults.kinds import KINDS

parser = argparse.ArgumentParser(prog="faults", description=__doc__)
parser.add_argument("--seed", type=int, default=0, help="the first seed")
parser.add_argument("--only", choices=[*KINDS], action="append", metavar="KIND", help=", ".join(KINDS))
parser.add_argument("--tries", type=int, default=1, help="faults of each kind")
parser.add_argument("--seconds", type=float, default=float("inf"), help="begin none after so long")

if __name__ == "__main__":
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        found = campaign(Path(folder), asked.only or [*KINDS], asked.tries, asked.seed, asked.seconds)
    print(table(found))
    sys.exit(any(tally.failures or tally.lost for tally in found.values()))
