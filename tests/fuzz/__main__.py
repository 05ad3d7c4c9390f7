"""`python -m fuzz`: the table."""

import argparse
import sys

from fuzz.campaign import campaign, table
from fuzz.formats import FORMATS

parser = argparse.ArgumentParser(prog="fuzz", description=__doc__)
parser.add_argument("--first", type=int, default=0, help="number of the first mutation of each format")
parser.add_argument("--only", choices=[*FORMATS], action="append", metavar="FORMAT", help=", ".join(FORMATS))
parser.add_argument("--count", type=int, default=1000, help="how many in all")

if __name__ == "__main__":
    asked = parser.parse_args()
    found = campaign(asked.only or [*FORMATS], asked.count, asked.first)
    print(table(found))
    sys.exit(any(tally.failures for tally in found.values()))
