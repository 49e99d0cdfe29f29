"""Whatever bytes a terminal sends, in whatever pieces: keys with a meaning come out, and a sitting goes on."""

from __future__ import annotations

import random
from itertools import count
from math import isfinite

from fbql.keyboard.page import driving_side
from fbql.keyboard.sitting import Sitting
from fbql.keyboard.steering import Steering
from fbql.watch.page import page
from fbql_behaviors.core.observation import observation_of
from fbql_common.terminal.keys import DRIVING, Key, KeyDecoder
from fbql_sim.core.world_loop import WorldLoop
from fuzzing import dice, odd_word

PIECES = (
    *(
        b"w",
        b"S",
        b"a",
        b"d",
        b" ",
        b"n",
        b"\r",
        b"\n",
        b"u",
        b"q",
        b"\x1b",
        b"\x1b[",
        b"\x1bO",
        b"A",
        b"D",
        b"[",
        b";",
    ),
    *(b"\x1b[A", b"\x1b[1;5C", b"\x1bOB", b"\x1b[200~", b"\x1b]0;x\x07", b"\x1bP1$r\x1b\\", b"\x9bA", b"\x00", b"\xff"),
    *("é".encode(), "\u202e".encode(), b"\x1b" * 70, b"\x1b[" + b"1" * 100, b"\x03", b"\x1a", b"\x7f"),
)


def typed(rng: random.Random) -> bytes:
    """What a person, a terminal or a paste sends."""
    parts = [rng.choice(PIECES) for _ in range(rng.randrange(30))]
    parts += [rng.randbytes(rng.randrange(40)), odd_word(rng).encode()[:100]]
    rng.shuffle(parts)
    return b"".join(parts)


def test_any_bytes_are_the_same_keys_in_whatever_pieces_they_come():
    for rng in dice(300):
        data = typed(rng)
        whole = KeyDecoder().feed(data)
        decoder, keys, at = KeyDecoder(), list[Key](), 0
        while at < len(data):
            size = rng.choice((1, 1, 2, 5, 1000))
            keys += decoder.feed(data[at : at + size])
            at += size
        assert all(isinstance(key, Key) for key in whole)
        assert len(whole) <= len(data)
        # A sequence that is longer than any key's may be cut where it comes in pieces.
        if not any(len(part) > 60 for part in data.split(b"\x1b")[1:]):
            assert keys == whole
        assert decoder.feed(b"") == []
        assert decoder.feed(b"w") == [Key.FASTER], "nothing stays behind a lone Escape"


def test_any_keys_drive_a_sitting_on_and_keep_what_was_driven():
    for rng in dice(4):
        sitting, steering, loop = Sitting(count(100), 6, 20), Steering(), WorldLoop()
        world = loop.reset(0, 100)
        decoder, now_s, dropped = KeyDecoder(), 0.0, 0
        for _ in range(60):
            now_s += rng.choice((0.0, 0.01, 0.5, 1e6))
            for key in decoder.feed(typed(rng)):
                if key in DRIVING:
                    steering.press(key, now_s)
                    sitting.begun = True
                elif key is Key.NEXT:
                    steering.stop()
                    sitting.next()
                elif key is Key.UNDO:
                    steering.stop()
                    dropped += sitting.undo() is not None
            if world.episode != sitting.episode or world.ended:
                world = loop.reset(sitting.episode, sitting.seed)
            for _ in range(rng.randrange(5)):
                if world.ended or not sitting.awaits(world):
                    break
                left, right = steering.command(now_s)
                assert isfinite(left) and isfinite(right)
                sitting.drive(world, left, right)
                world = loop.step(left, right)
            if rng.random() < 0.8:  # drawing takes longest
                continue
            columns, rows, ascii_only = rng.randrange(300), rng.randrange(120), rng.random() < 0.5
            side = driving_side(
                *("ball_seeking", observation_of("ball_seeking"), sitting, steering, world, now_s, 0.02, ascii_only)
            )
            lines = page(world, side, odd_word(rng), columns, rows, ascii_only)
            assert len(lines) <= max(rows, 1)
            assert all(sum(len(text) for text, _ in line) <= max(columns, 1) for line in lines), (columns, rows)
        for kept in sitting.kept:
            steps = [each.step for each in kept.demonstration.worlds]
            assert steps == list(range(len(steps))) and steps
