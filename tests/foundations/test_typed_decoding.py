"""Many threads that meet a type at once all get its values (and the process lives on)."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import make_dataclass

import msgspec
import pytest

from studio.foundations.typed_decoding import decode_json, decode_toml


def test_threads_may_meet_a_type_together() -> None:
    with ThreadPoolExecutor(8) as pool:
        for round_ in range(20):
            fresh = make_dataclass(f"Fresh{round_}", [(f"entry{at}", int) for at in range(20)], frozen=True)
            text = "{" + ",".join(f'"entry{at}":{at}' for at in range(20)) + "}"
            values = list(pool.map(lambda _, text=text, fresh=fresh: decode_json(text, fresh), range(8)))
            assert len(set(values)) == 1


def test_what_does_not_fit_is_refused() -> None:
    with pytest.raises(msgspec.ValidationError, match="int"):
        decode_toml('a = "x"', dict[str, int])


@pytest.mark.parametrize("content", [b'"\xff"', b"[" * 20_000, b"9" * 5000], ids=["no UTF-8", "deep", "long"])
def test_whatever_a_parser_raises_is_a_decode_error(content: bytes) -> None:
    with pytest.raises(msgspec.DecodeError):
        decode_json(content, dict[str, int])
    with pytest.raises(msgspec.DecodeError):
        decode_toml(b"a = " + content, dict[str, int])
