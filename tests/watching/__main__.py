"""`python -m watching`: what looking at the studio takes, in figures."""

import argparse
import sys
import tempfile
from pathlib import Path

from conftest import ARGUMENTS, chromium
from playwright.sync_api import sync_playwright

from watching.first_steps import measure_first_steps
from watching.layers import measure_layers
from watching.long_run import measure_long_run
from watching.slider import measure_slider
from watching.windows import measure_windows

PARTS = {
    "slider": measure_slider,
    "first-steps": measure_first_steps,
    "windows": measure_windows,
    "long-run": measure_long_run,
    "layers": measure_layers,
}

if __name__ == "__main__":
    parser = argparse.ArgumentParser(prog="watching", description=__doc__)
    parser.add_argument("parts", nargs="*", choices=[*PARTS, []], help="default: all")
    wrong = False
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=chromium(playwright), headless=True, args=ARGUMENTS
        )
        for name in parser.parse_args().parts or PARTS:
            with tempfile.TemporaryDirectory() as folder:
                found = PARTS[name](browser, Path(folder))
            print(f"{name}\n{found.table()}", flush=True)
            wrong = wrong or bool(found.wrong)
        browser.close()
    sys.exit(wrong)
