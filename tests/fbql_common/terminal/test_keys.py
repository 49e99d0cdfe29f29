"""From a terminal's bytes to keys."""

from __future__ import annotations

import pytest
from fbql_common.terminal.keys import WATCHING_KEYS, Key, KeyDecoder
from hypothesis import given
from hypothesis import strategies as st

MEANINGS = {
    b"w": Key.FASTER,
    b"W": Key.FASTER,
    b"s": Key.SLOWER,
    b"a": Key.LEFT,
    b"d": Key.RIGHT,
    b" ": Key.STOP,
    b"n": Key.NEXT,
    b"\r": Key.NEXT,
    b"u": Key.UNDO,
    b"q": Key.FINISH,
    b"\x1b[A": Key.FASTER,
    b"\x1bOB": Key.SLOWER,
    b"\x1b[C": Key.RIGHT,
    b"\x1bOD": Key.LEFT,
    b"\x1b[1;2D": Key.LEFT,
}
WITHOUT_MEANING = [
    b"z",
    b"\x1b[24~",  # F12
    b"\x1b[200~",  # beginning of something pasted
    b"\x1b[I",  # focus
    b"\x1bOP",  # F1
    b"\x1bd",  # Alt-d
    b"\xc3\xa4",
    b"\x00",
    b"\x1b[" + b"1;" * 100,
]


@pytest.mark.parametrize("data", MEANINGS)
def test_a_key_means_what_the_screen_says(data: bytes) -> None:
    assert KeyDecoder().feed(data) == [MEANINGS[data]]


@pytest.mark.parametrize("data", WITHOUT_MEANING)
def test_a_key_without_a_meaning_is_none_and_swallows_none(data: bytes) -> None:
    decoder = KeyDecoder()
    assert decoder.feed(data) == []
    assert decoder.feed(b"") == []
    assert decoder.feed(b"q") == [Key.FINISH]


@given(st.lists(st.sampled_from(list(MEANINGS))), st.data())
def test_keys_are_the_same_in_whatever_pieces_they_come(words: list[bytes], data: st.DataObject) -> None:
    sent = b"".join(words)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(sent)), max_size=5)))
    decoder = KeyDecoder()
    keys: list[Key] = []
    for begin, end in zip([0, *cuts], [*cuts, len(sent)], strict=True):
        if end > begin:
            keys += decoder.feed(sent[begin:end])
    assert keys == [MEANINGS[word] for word in words]


@given(st.binary())
def test_no_bytes_break_the_decoder_or_stay_in_it(data: bytes) -> None:
    decoder = KeyDecoder()
    decoder.feed(data)
    decoder.feed(b"")
    assert decoder.feed(b"n") == [Key.NEXT]


def test_an_escape_key_that_is_alone_takes_no_later_key_along() -> None:
    decoder = KeyDecoder()
    assert decoder.feed(b"\x1b") == []
    assert decoder.feed(b"") == []
    assert decoder.feed(b"d") == [Key.RIGHT]


def test_whoever_watches_has_other_keys_than_whoever_drives() -> None:
    pressed = b" s+=-nuq\x1b[A\x1b[B"
    faster, slower = Key.FASTER, Key.SLOWER
    assert KeyDecoder(WATCHING_KEYS).feed(pressed) == [
        *(Key.PAUSE, Key.STEP, faster, faster, slower, Key.NEXT, Key.UNDO, Key.FINISH, faster, slower)
    ]
