"""`python -m supply_chain`: the table, and the bill as a file."""

import argparse
import json
import sys
from pathlib import Path

from supply_chain.bill import bill, components, doubts, table

parser = argparse.ArgumentParser(prog="supply_chain", description=__doc__)
parser.add_argument("--out", type=Path, help="where the bill is written as CycloneDX JSON")

if __name__ == "__main__":
    asked = parser.parse_args()
    found = components()
    print(table(found))
    if asked.out:
        asked.out.parent.mkdir(parents=True, exist_ok=True)
        asked.out.write_text(json.dumps(bill(found), indent=1) + "\n", encoding="utf-8")
        print(f"{len(found)} components in {asked.out}")
    wrong = doubts(found)
    print("\n".join(wrong))
    sys.exit(bool(wrong))
