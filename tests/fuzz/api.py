"""`python -m fuzz.api`: requests made of the API's own description, to a server whose session and run stay there.

Schemathesis makes them, valid and not, and compares the answers with the description: no answer is a 5xx, and each has
a status, a type and a content that is declared.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

from faults.process_kinds import Served, server
from faults.stage import DONE, TOY, Stage

CHECKS = "not_a_server_error,status_code_conformance,content_type_conformance,response_schema_conformance"
PARAMETERS = f"""
[parameters]
"path.session" = "{TOY}"
"path.run" = "{DONE}"
"path.camera" = "front"

[phases.coverage]
unexpected-methods = ["PUT", "TRACE"]
"""
REMOVING = ("/api/sessions/{session}", "/api/sessions/{session}/runs/{run}")
"""What is deleted or renamed there is not there for the requests that follow. Nor may methods that are left out of the
description for that be tried as unexpected ones.
"""
LONG = (
    "/comparisons",
    "/learning",
    "/recordings",
    "/solve",
    "/initialise",
    "/fit-subject",
    "/worker/restart",
)
"""Each of these begins work of minutes."""


def left_to_ask(document: dict) -> dict:
    """The API's description without what removes the session or the run, or begins work of minutes."""
    paths = {
        path: {
            method: operation
            for method, operation in operations.items()
            if not (path in REMOVING and method in ("delete", "patch"))
            and not (method == "post" and path.endswith(LONG))
        }
        for path, operations in document["paths"].items()
    }
    return document | {"paths": {path: operations for path, operations in paths.items() if operations}}


def ask(
    studio: Served, folder: Path, examples: int, seed: int, seconds: int | None = None
) -> tuple[int, str]:
    """Ask each operation so many times in each phase. seconds : at most. Returns the exit code and what is said."""
    document = studio.client.get("/api/openapi.json").json()
    (folder / "openapi.json").write_text(json.dumps(left_to_ask(document)))
    (folder / "schemathesis.toml").write_text(PARAMETERS)
    base = str(studio.client.base_url).rstrip("/")
    cookies = "; ".join(f"{name}={value}" for name, value in studio.client.cookies.items())
    command = [
        sys.executable,
        "-m",
        "schemathesis.cli",
        "--config-file",
        "schemathesis.toml",
        "run",
        "openapi.json",
    ]
    command += [
        "--url",
        base,
        "--header",
        f"Cookie: {cookies}",
        "--header",
        f"Origin: {base}",
        "--checks",
        CHECKS,
    ]
    command += ["--phases", "examples,coverage,fuzzing", "--max-examples", str(examples), "--seed", str(seed)]
    command += ["--continue-on-failure", "--no-shrink", "--no-color", "--warnings", "off"]
    command += [] if seconds is None else ["--max-time", str(seconds)]
    done = subprocess.run(command, capture_output=True, text=True, check=False, cwd=folder)
    return done.returncode, done.stdout + done.stderr


def main() -> None:
    """Ask, print what is said, and end with its exit code."""
    parser = argparse.ArgumentParser(prog="fuzz.api", description=__doc__)
    parser.add_argument("--examples", type=int, default=20, help="requests of each operation")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--seconds", type=int, help="at most")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        place = Stage(Path(folder)).place("api")
        with server(place) as studio:
            code, said = ask(studio, Path(folder), asked.examples, asked.seed, asked.seconds)
            print(said)
            studio.finish()
    sys.exit(code)


if __name__ == "__main__":
    main()
