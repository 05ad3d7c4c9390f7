"""The parts: Python packages of the lock, and what is vendored for the pages. Reads files of the checkout and the
metadata of what is installed; asks no network.
"""

import hashlib
import importlib.metadata
import re
import tomllib
import uuid
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
WEIGHTS = ROOT / "studio" / "evidence" / "models"
LOCK, PROJECT, VENDORED = ROOT / "requirements.lock", ROOT / "pyproject.toml", ROOT / "web_assets" / "vendor"
ENTRY = re.compile(r"^([A-Za-z0-9._-]+)(?:\[[^\]]*\])?==([^\s;\\]+)(?:\s*;\s*([^\\]+?))?\s*\\?$")
DIGEST = re.compile(r"--hash=sha256:([0-9a-f]{64})")
NAME = re.compile(r"[A-Za-z0-9._-]+")
UNKNOWN = "unknown"

SPELLINGS: Mapping[str, str] = {
    "MIT License": "MIT",
    "The MIT License (MIT)": "MIT",
    "BSD": "BSD-3-Clause",
    "BSD License": "BSD-3-Clause",
    "BSD 2-Clause License": "BSD-2-Clause",
    "BSD 3-Clause License": "BSD-3-Clause",
    "Apache 2.0": "Apache-2.0",
    "Apache Software License": "Apache-2.0",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
    "PSFL": "PSF-2.0",
    "BSD-3-Clause, Apache-2.0, dependency licenses": "BSD-3-Clause AND Apache-2.0",
}
"""How packages say it, by SPDX's names."""
READ: Mapping[str, str] = {
    "axe-playwright-python": "MIT AND MPL-2.0",
    "colorama": "BSD-3-Clause",
    "ezc3d": "MIT",
    "python-osc": "Unlicense",
    "tzdata": "Apache-2.0",
}
"""Read from the projects' own licence files: their metadata says nothing, or they are for other systems only."""
FREE = frozenset((
    "0BSD", "Apache-2.0", "Apache-2.0 WITH LLVM-exception", "BSD-2-Clause", "BSD-3-Clause", "CC0-1.0", "MIT", "MIT-0",
    "LicenseRef-TOST-1.0", "MIT-CMU", "OFL-1.1", "PSF-2.0", "Unlicense", "Zlib",
))  # fmt: skip
WEAK = frozenset(("LGPL-3.0-only", "MPL-2.0"))
"""Their own files stay under them; what imports them unchanged does not."""
OF_TOOLS = frozenset(("GPL-3.0-or-later", "LicenseRef-NVIDIA-Proprietary"))
"""Of what is used to develop the studio alone, and never passed on with it."""
NOTES: Mapping[str, str] = {
    "nvidia-nvvm": "NVIDIA's compiler, under NVIDIA's own terms; it makes kernels into PTX in tests",
    "nvidia-cuda-nvrtc": "likewise",
    "av": "its wheel holds FFmpeg with libx264, under the GPL: who passes the wheel on does so under its terms",
    "usd-core": "the Tomorrow Open Source Technology License 1.0: Apache 2.0 with another clause on trademarks",
    "fpdf2": "used unchanged, as a package that can be replaced",
}


@dataclass(frozen=True, slots=True)
class Component:
    """kind : "pypi", or "file" for what is vendored. licence : an SPDX expression, or UNKNOWN. hashes : SHA-256 of
    its files. runs : whether the studio needs it to run (else: to be developed). needs : names of others.
    """

    kind: str
    name: str
    version: str
    licence: str
    hashes: tuple[str, ...]
    runs: bool
    needs: tuple[str, ...] = ()

    @property
    def reference(self) -> str:
        """Its package URL."""
        return f"pkg:{'pypi' if self.kind == 'pypi' else 'generic'}/{self.name}@{self.version}"


def components() -> tuple[Component, ...]:
    """All parts, by kind and name; of a package that the lock has in several versions, each."""
    found = _locked()
    names = {name for name, _, _ in found}
    needs = {name: tuple(sorted(_needed(name) & names)) for name in names}
    project = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    running = _closure({_canonical(line) for line in project["dependencies"]}, needs)
    packages = [
        Component("pypi", name, version, licence_of(name), hashes, name in running, needs[name])
        for name, version, hashes in found
    ]
    return (*packages, *_vendored())


def _locked() -> list[tuple[str, str, tuple[str, ...]]]:
    """Name, version and hashes of each entry of the lock."""
    found: list[tuple[str, str, list[str]]] = []
    for line in LOCK.read_text(encoding="utf-8").splitlines():
        if entry := ENTRY.match(line):
            found.append((_canonical(entry[1]), entry[2], []))
        elif digest := DIGEST.search(line):
            found[-1][2].append(digest[1])
    return [(name, version, tuple(hashes)) for name, version, hashes in found]


def _canonical(requirement: str) -> str:
    found = NAME.match(requirement)
    assert found is not None, requirement
    return re.sub(r"[-_.]+", "-", found[0]).lower()


def _needed(name: str) -> set[str]:
    """What an installed package requires, extras apart; nothing of what is not installed."""
    try:
        required = importlib.metadata.requires(name) or []
    except importlib.metadata.PackageNotFoundError:
        return set()
    return {_canonical(line) for line in required if "extra ==" not in line}


def _closure(start: Iterable[str], needs: Mapping[str, Sequence[str]]) -> set[str]:
    found: set[str] = set()
    open_ones = [*start]
    while open_ones:
        name = open_ones.pop()
        if name not in found:
            found.add(name)
            open_ones += needs.get(name, ())
    return found


def licence_of(name: str) -> str:
    """The SPDX expression of an installed package, UNKNOWN where it does not say."""
    if name in READ:
        return READ[name]
    try:
        said = importlib.metadata.metadata(name)
    except importlib.metadata.PackageNotFoundError:
        return UNKNOWN
    if expression := said.get("License-Expression"):
        return expression
    line = (said.get("License") or "").strip().partition("\n")[0]
    marks = [
        entry.rpartition("::")[2].strip()
        for entry in said.get_all("Classifier") or []
        if "License ::" in entry
    ]
    for text in (line, *marks):
        spelt = SPELLINGS.get(text, text)
        if _parts(spelt) <= FREE | WEAK:
            return spelt
    return UNKNOWN


def _parts(expression: str) -> set[str]:
    return {part.strip("() ") for part in re.split(r"\b(?:AND|OR)\b", expression)}


def _vendored() -> list[Component]:
    """From the tables in the folders' READMEs: what the pages are made of, and the network's weights."""
    found: list[Component] = []
    for folder in (VENDORED, WEIGHTS):
        rows = re.findall(
            r"^\| `([^`]+)` \| ([^:|]+):[^|]*\| ([^|]+) \| ([\w.-]+) ",
            (folder / "README.md").read_text(encoding="utf-8"),
            re.M,
        )
        for file, what, version, licence in rows:
            digest = hashlib.sha256((folder / file).read_bytes()).hexdigest()
            number = re.match(r"[\d.]+$", version.strip())
            assert number, f"{file}: the README names no version"
            name = _canonical(what.split(",")[0].replace(" ", "-"))
            found.append(Component("file", name, number[0], licence, (digest,), True))
    return found


def doubts(found: Iterable[Component]) -> list[str]:
    """What is to be answered before a release: a licence that is not known, or that binds what uses it."""
    wrong: list[str] = []
    for one in found:
        allowed = FREE | WEAK if one.runs else FREE | WEAK | OF_TOOLS
        if not _parts(one.licence) <= allowed:
            wrong.append(
                f"{one.name} {one.version}: its licence ({one.licence}) is not among those that were agreed to"
            )
        if not one.hashes:
            wrong.append(f"{one.name} {one.version}: the lock has no hash of it")
    return wrong


def table(found: Sequence[Component]) -> str:
    """A line each, what runs first."""
    lines = [f"{'component':28}{'version':16}{'for':9}licence"]
    for one in sorted(found, key=lambda one: (not one.runs, one.name, one.version)):
        note = f" ({NOTES[one.name]})" if one.name in NOTES else ""
        lines.append(f"{one.name:28}{one.version:16}{'running' if one.runs else 'work':9}{one.licence}{note}")
    return "\n".join(lines)


def bill(found: Sequence[Component]) -> dict[str, object]:
    """CycloneDX 1.6. The same parts give the same bill, but for nothing: it has no time."""
    project = tomllib.loads(PROJECT.read_text(encoding="utf-8"))["project"]
    own = f"pkg:pypi/{project['name']}@{project['version']}"
    by_name: dict[str, list[str]] = {}
    for one in found:
        by_name.setdefault(one.name, []).append(one.reference)
    direct = [reference for line in project["dependencies"] for reference in by_name[_canonical(line)]]
    direct += [one.reference for one in found if one.kind == "file"]
    identity = hashlib.sha256(
        "\n".join(f"{one.reference} {one.hashes}" for one in found).encode()
    ).hexdigest()
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "serialNumber": f"urn:uuid:{uuid.UUID(identity[:32], version=4)}",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application",
                "bom-ref": own,
                "name": project["name"],
                "version": project["version"],
                "purl": own,
                "licenses": [{"expression": project["license"]}],
            }
        },
        "components": [_entry(one) for one in found],
        "dependencies": [
            {"ref": own, "dependsOn": sorted(set(direct))},
            *(
                {
                    "ref": one.reference,
                    "dependsOn": sorted(ref for need in one.needs for ref in by_name[need]),
                }
                for one in found
            ),
        ],
    }


def _entry(one: Component) -> dict[str, object]:
    entry: dict[str, object] = {
        "type": "library",
        "bom-ref": one.reference,
        "name": one.name,
        "version": one.version,
        "scope": "required" if one.runs else "excluded",
        "purl": one.reference,
        "licenses": [{"expression": one.licence}] if one.licence != UNKNOWN else [],
    }
    if one.kind == "file":
        entry["hashes"] = [{"alg": "SHA-256", "content": one.hashes[0]}]
    else:
        # A package has a file for each system: any of these may be installed.
        entry["properties"] = [{"name": "studio:sha256", "value": digest} for digest in one.hashes]
    return entry
