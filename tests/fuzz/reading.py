"""The process that reads: `python -m fuzz.reading FIRST COUNT FORMAT…` prints JSON before and after each file."""

import contextlib
import json
import os
import resource
import sys
import tempfile
import time
import traceback
import zlib
from pathlib import Path

import numpy as np

from fuzz.formats import FORMATS
from fuzz.mutations import mutated
from studio.foundations.errors import StudioError

MEMORY_BYTES = 12 << 30
CORPUS = Path(__file__).resolve().parent / "corpus"


class Bench:
    """The valid files of a format in a folder, of which one at a time is malformed."""

    def __init__(self, name: str, folder: Path) -> None:
        self.format, self.folder = FORMATS[name], folder / name
        self.format.fill(name, self.folder)
        found = sorted(path for path in self.folder.glob(self.format.files) if path.is_file())
        self.files = {path.relative_to(self.folder).as_posix(): path.read_bytes() for path in found}

    def read(self, file: str, content: bytes) -> str:
        """What comes of reading it with that content: "read", "refused" or a traceback."""
        path = self.folder / file
        path.write_bytes(content)
        said = "read"
        try:
            for read in self.format.readers:
                try:
                    read(self.folder)
                except StudioError as error:
                    said = "refused" if error.message and error.hint else f"without a remedy: {error.message}"
                except Exception:
                    return traceback.format_exc(limit=-4)
        finally:
            with contextlib.suppress(FileNotFoundError):
                os.chmod(path, 0o644)
            path.write_bytes(self.files[file])
            for ending in ("-wal", "-shm"):
                path.with_name(path.name + ending).unlink(missing_ok=True)
        return said


def mutation(bench: Bench, name: str, number: int) -> tuple[str, bytes]:
    """A file of a format and its content, by number."""
    rng = np.random.default_rng((zlib.crc32(name.encode()), number))
    files = sorted(bench.files)
    file = files[int(rng.integers(len(files)))]
    return file, mutated(bench.files[file], rng)


def main() -> None:
    """Read so many mutations of each format, one format after another for each number."""
    first, count, names = int(sys.argv[1]), int(sys.argv[2]), sys.argv[3:]
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    # What libraries print must not speak in between.
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
    with tempfile.TemporaryDirectory() as folder:
        benches = {name: Bench(name, Path(folder)) for name in names}
        for place in range(first, first + count):
            number, name = divmod(place, len(names))
            bench = benches[names[name]]
            file, content = mutation(bench, names[name], number)
            print(json.dumps([place, "reads", file]), file=answers)
            began = time.process_time()
            said = bench.read(file, content)
            print(json.dumps([place, said, time.process_time() - began]), file=answers)


if __name__ == "__main__":
    main()
