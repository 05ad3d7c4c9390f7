"""The studio's colours, read from the pages' style sheet (`tokens.css`).

The pages use the same file, so a colour means one thing in the scene, on the overlays and in the charts.
"""

import re
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from studio.foundations.errors import StudioError
from studio.foundations.package import assets_folder

Colour = tuple[int, int, int]
LAYER_STOPS = 10

_BLOCK = re.compile(r":root([^{]*)\{([^}]*)\}")
_ENTRY = re.compile(r"--([a-z0-9-]+)\s*:\s*#([0-9a-fA-F]{6})\s*;")


@dataclass(frozen=True)
class ColourTokens:
    """One theme's colours. name : "dark" or "light". colours : token name (without dashes) to RGB, 0..255."""

    name: str
    colours: dict[str, Colour]

    def __getitem__(self, token: str) -> Colour:
        """The RGB of a token such as "limb-left". Raises StudioError for one that the file does not declare."""
        if token not in self.colours:
            raise StudioError(
                f"The colour '--{token}' is not declared for the {self.name} theme.",
                "Declare it in tokens.css.",
            )
        return self.colours[token]

    def layer(self, index: int, count: int) -> Colour:
        """The RGB of layer `index` of `count`, from cool to warm."""
        return _on_ramp(self._stops(), 1.0 if count <= 1 else index / (count - 1))

    def ramp(self, shares: NDArray[np.float64]) -> NDArray[np.uint8]:
        """(N,) numbers in 0..1 to (N, 3) uint8 RGB along the layers' ramp, cool to warm."""
        return _along(self._stops(), shares)

    def _stops(self) -> tuple[Colour, ...]:
        return tuple(self[f"layer-{stop}"] for stop in range(LAYER_STOPS))


def _along(stops: tuple[Colour, ...], shares: NDArray[np.float64]) -> NDArray[np.uint8]:
    """(N,) numbers in 0..1 to (N, 3) uint8 RGB between colours at even distances."""
    place, colours = np.clip(shares, 0.0, 1.0) * (len(stops) - 1), np.array(stops, dtype=np.float64)
    channels = [np.interp(place, np.arange(len(stops)), colours[:, channel]) for channel in range(3)]
    return np.round(np.stack(channels, axis=-1)).astype(np.uint8)


@cache
def _on_ramp(stops: tuple[Colour, ...], share: float) -> Colour:
    red, green, blue = _along(stops, np.array([share]))[0]
    return int(red), int(green), int(blue)


def tokens_file() -> Path:
    """The path of `tokens.css`, which lies beside the pages."""
    return assets_folder() / "tokens.css"


def parse_tokens(text: str) -> dict[str, ColourTokens]:
    """The themes "dark" and "light" declared in a style sheet; a block without a theme counts for dark."""
    themes: dict[str, dict[str, Colour]] = {"dark": {}, "light": {}}
    for selector, body in _BLOCK.findall(text):
        name = "light" if "light" in selector else "dark"
        for token, digits in _ENTRY.findall(body):
            themes[name].setdefault(token, _rgb(digits))
    light = themes["dark"] | themes["light"]
    return {"dark": ColourTokens("dark", themes["dark"]), "light": ColourTokens("light", light)}


@cache
def colour_tokens(dark: bool = True) -> ColourTokens:
    """The colours of the dark or the light theme. Raises StudioError where the file is missing."""
    path = tokens_file()
    if not path.is_file():
        raise StudioError(f"The style sheet {path.name} is missing.", "Install the package again.")
    return parse_tokens(path.read_text(encoding="utf-8"))["dark" if dark else "light"]


def _rgb(digits: str) -> Colour:
    return int(digits[0:2], 16), int(digits[2:4], 16), int(digits[4:6], 16)
