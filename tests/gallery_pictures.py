"""The pictures of the gallery's cards that are rendered at a click: a frame of each, `make gallery-pictures`."""

import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT)]

from studio.operations.gallery import CARDS, GALLERY_PICTURES, make_card  # noqa: E402
from studio.progress import unheard  # noqa: E402
from studio.sessions.session import thumbnail_of  # noqa: E402

FRAMES = 2


def main(names: list[str]) -> None:
    """Take those that are named, else all."""
    GALLERY_PICTURES.mkdir(exist_ok=True)
    for card in CARDS:
        if card.kind != "recipe" or (names and card.name not in names):
            continue
        with tempfile.TemporaryDirectory() as folder:
            content = thumbnail_of(make_card(card, Path(folder) / card.name, FRAMES, unheard))
        if content is None:
            raise SystemExit(f"{card.name} has no picture.")
        (GALLERY_PICTURES / f"{card.name}.jpg").write_bytes(content)
        print(f"{card.name}: {len(content)} bytes", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
