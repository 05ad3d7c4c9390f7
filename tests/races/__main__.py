"""`python -m races`: what became of the groups."""

import argparse
import sys
import tempfile
from pathlib import Path

from races.campaign import campaign, table
from races.verbs import VERBS

parser = argparse.ArgumentParser(prog="races", description=__doc__)
parser.add_argument(
    "--seed", type=int, default=0, help="of the first group; each next one has the next number"
)
parser.add_argument("--groups", type=int, default=50, help="how many")
parser.add_argument("--only", choices=[*VERBS], action="append", metavar="VERB", help=", ".join(VERBS))
parser.add_argument(
    "--kept",
    type=Path,
    metavar="FILE",
    help="keep the numbers there; with them there, go on after their seeds",
)
parser.add_argument("--seconds", type=float, default=float("inf"), help="begin none after so long")

if __name__ == "__main__":
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="races-") as folder:
        found = campaign(
            Path(folder),
            range(asked.seed, asked.seed + asked.groups),
            asked.only or [*VERBS],
            asked.seconds,
            each=lambda line: print(line, flush=True),
            kept=asked.kept,
        )
    print(table(found))
    sys.exit(bool(found.wrong))
