"""How files are malformed: by rules that fit all of them, and at random by seed."""

import re
from collections.abc import Callable, Mapping

import numpy as np

NUMBER = re.compile(rb"-?\d+\.?\d*(?:[eE][-+]?\d+)?")
WORDS = (
    b"nan", b"inf", b"-1", b"0", b"1e308", b"-1e999", b"1e-320", b"9" * 400, b"99999999999", b"2147483648", b"1.5", b"",
    b'"x"', b"[]", b"{}", b"null", b"true", b"\xff\xfe", b"\x00", b"../../x", b"%s", b"\xe2\x80\xae", b"[" * 3000,
)  # fmt: skip
INTEGERS = (0, 1, -1, 127, 255, 256, 32767, -32768, 65535, 1 << 24, 2147483647, -2147483648)


def _numbers_as(word: bytes) -> Callable[[bytes], bytes]:
    return lambda content: NUMBER.sub(word, content)


RULES: Mapping[str, Callable[[bytes], bytes]] = {
    "empty": lambda _: b"",
    "one-byte": lambda content: content[:1],
    "half": lambda content: content[: len(content) // 2],
    "all-but-the-end": lambda content: content[:-9],
    "without-its-head": lambda content: content[16:],
    "zeros": lambda content: bytes(len(content)),
    "ones": lambda content: b"\xff" * len(content),
    "twice": lambda content: content + content,
    "backwards": lambda content: content[::-1],
    "noise": lambda content: np.random.default_rng(len(content)).bytes(len(content)),
    "utf-16": lambda content: content.decode("latin-1").encode("utf-16"),
    "byte-order-mark": lambda content: b"\xef\xbb\xbf" + content,
    "deep": lambda content: content + b"[" * 20_000,
    "long-line": lambda content: content.replace(b"\n", b" ") * 3,
    "numbers-gone": _numbers_as(b""),
    "numbers-huge": _numbers_as(b"1e308"),
    "numbers-negative": _numbers_as(b"-7"),
    "numbers-not-numbers": _numbers_as(b"nan"),
    "numbers-of-400-digits": _numbers_as(b"9" * 400),
    "numbers-zero": _numbers_as(b"0"),
}  # fmt: skip
"""Ways in which every file of the corpus is malformed."""


def mutated(content: bytes, rng: np.random.Generator) -> bytes:
    """One to four changes at random places."""
    for _ in range(int(rng.integers(1, 5))):
        content = MUTATIONS[int(rng.integers(len(MUTATIONS)))](content, rng)
    return content[: 1 << 20]


def _flip(content: bytes, rng: np.random.Generator) -> bytes:
    changed = bytearray(content)
    for _ in range(int(rng.integers(1, 4)) if changed else 0):
        changed[int(rng.integers(len(changed)))] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _span(content: bytes, rng: np.random.Generator) -> tuple[int, int]:
    first = int(rng.integers(len(content) + 1))
    return first, min(len(content), first + int(rng.geometric(0.05)))


def _drop(content: bytes, rng: np.random.Generator) -> bytes:
    first, last = _span(content, rng)
    return content[:first] + content[last:]


def _repeat(content: bytes, rng: np.random.Generator) -> bytes:
    first, last = _span(content, rng)
    return content[:last] + content[first:last] * int(rng.integers(1, 50)) + content[last:]


def _move(content: bytes, rng: np.random.Generator) -> bytes:
    first, last = _span(content, rng)
    at = int(rng.integers(len(content) + 1))
    return content[:at] + content[first:last] + content[at:]


def _noise(content: bytes, rng: np.random.Generator) -> bytes:
    first, last = _span(content, rng)
    return content[:first] + rng.bytes(last - first) + content[last:]


def _cut(content: bytes, rng: np.random.Generator) -> bytes:
    return content[: int(rng.integers(len(content) + 1))]


def _integer(content: bytes, rng: np.random.Generator) -> bytes:
    size, order = int(rng.choice([1, 2, 4, 8])), str(rng.choice(["little", "big"]))
    value = int(rng.choice(INTEGERS)) & ((1 << 8 * size) - 1)
    at = int(rng.integers(len(content) + 1))
    return content[:at] + value.to_bytes(size, order) + content[at + size :]  # pyright: ignore[reportArgumentType]


def _word(content: bytes, rng: np.random.Generator) -> bytes:
    at = int(rng.integers(len(content) + 1))
    return content[:at] + WORDS[int(rng.integers(len(WORDS)))] + content[at:]


def _number(content: bytes, rng: np.random.Generator) -> bytes:
    found = list(NUMBER.finditer(content))
    if not found:
        return _word(content, rng)
    one = found[int(rng.integers(len(found)))]
    return content[: one.start()] + WORDS[int(rng.integers(len(WORDS)))] + content[one.end() :]


def _line(content: bytes, rng: np.random.Generator) -> bytes:
    lines = content.split(b"\n")
    one, other = (int(rng.integers(len(lines))) for _ in range(2))
    lines[one] = lines[other]
    return b"\n".join(lines)


MUTATIONS = (
    _flip,
    _flip,
    _drop,
    _repeat,
    _move,
    _noise,
    _cut,
    _integer,
    _integer,
    _word,
    _number,
    _number,
    _line,
)
