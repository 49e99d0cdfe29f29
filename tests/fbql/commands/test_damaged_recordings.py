"""Damaged recordings of every kind (faults 47 to 52 and 54): no reader of ours ends in a traceback, takes for ever, or
tells anything that was not recorded."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import damaged_recordings
import pytest
from commands import compare, replay, report
from commands import recover as recover_command
from damaged_recordings import HEAD_BYTES, Case, Sound, corpus, mcap_of, record_sound, records_of
from fbql.cli.interrupts import NUMBERS
from fbql_common.core.errors import BadInput
from fbql_recording.recovery.recover import recover
from fbql_recording.run import Run, open_run
from mcap.opcode import Opcode
from verified_run import verification_of

Told = tuple[Any, ...]
FEW_MIB = 700 << 20
"""Address space that reading anything may take, Python with NumPy and its libraries included."""

FEW = 2
"""By how many cases the counts below may be off: where a sector begins depends on how long the configuration is."""
READ = {"open": (106, 5), "open and skip": (365, 5), "recover": (361, 167)}
"""How many of the corpus are read, and how many of those are whole: where no chunk is damaged, recovery loses nothing."""


@pytest.fixture(scope="module")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Sound:
    return record_sound(tmp_path_factory.mktemp("sound"))


@pytest.fixture(scope="module")
def cases(sound: Sound) -> list[Case]:
    return list(corpus(sound))


@pytest.fixture(autouse=True)
def no_sync(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing has to survive a power cut here: the disk is not waited for."""
    monkeypatch.setattr(os, "fsync", lambda _: None)


@pytest.fixture
def signal_handlers() -> Iterator[None]:
    """The commands' own end with the test."""
    before = {number: signal.getsignal(number) for number in NUMBERS}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def told_by(run: Run) -> list[Told]:
    """Every message that a run tells, whole."""
    return list(run.messages())


def chunks_of(sound: Path) -> list[tuple[bytes, list[Told]]]:
    """The bytes and the messages of each chunk of a sound recording."""
    data, messages = mcap_of(sound).read_bytes(), iter(told_by(open_run(sound)))
    chunks: list[tuple[bytes, list[Told]]] = []
    for record in records_of(data):
        if record.opcode == Opcode.CHUNK:
            chunks.append((data[record.begin : record.end], []))
        elif record.opcode == Opcode.MESSAGE_INDEX:
            count = (record.end - record.begin - HEAD_BYTES - 6) // 16
            chunks[-1][1].extend(islice(messages, count))
    assert next(messages, None) is None
    return chunks


def is_part_of(told: Iterable[Told], recorded: list[Told]) -> bool:
    """Whether all of it was recorded, in this order."""
    rest = iter(recorded)
    return all(message in rest for message in told)


def untrue(run: Run, told: list[Told], recorded: Run, messages: list[Told], sound: Path) -> str:
    """What a run tells that was not recorded, or keeps back without a word; nothing: ""."""
    if not is_part_of(told, messages):
        return "tells messages that were not recorded"
    if run.is_complete and len(told) != len(messages):
        return f"is complete with {len(told)} of {len(messages)} messages"
    for name, topic in run.topics.items():
        if recorded.topics.get(name) != topic:
            return f"describes {name} in another way"
    for name, data in run.attachments.items():
        # A killed recording has no episodes.csv in it: recovery takes that from beside it.
        if recorded.attachments.get(name) != data != (sound / name).read_bytes():
            return f"has another {name}"
    return ""


def test_the_corpus_has_every_kind_of_damage(cases):
    names = [case.name for case in cases]
    assert len(set(names)) == len(names) >= 400
    kinds = ("header", "schema", "channel", "chunk", "message_index", "chunk_index", "statistics", "metadata")
    for kind in (*kinds, "attachment", "attachment_index", "metadata_index", "summary_offset", "footer", "data_end"):
        assert any(f"of the {kind} at" in name for name in names), kind
        assert any(f"cut after the {kind} at" in name for name in names), kind


def test_the_corpus_is_made_by_a_program_as_well(sound, cases, tmp_path, capsys, monkeypatch):
    """Here the program makes a few of them."""
    few = [*cases[::60], cases[-1]]
    monkeypatch.setattr(damaged_recordings, "record_sound", lambda _: sound)
    monkeypatch.setattr(damaged_recordings, "corpus", lambda _: few)
    place = tmp_path / "corpus"
    assert damaged_recordings.main([str(place)]) == 0
    lines = [line.split("\t") for line in (place / "index.tsv").read_text().splitlines()]
    assert len(lines) == len(few)
    assert [name for name, path in lines if not (place / path).exists()] == [repr("nothing there")]
    assert damaged_recordings.main([str(place)]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("how", ["open", "open and skip", "recover"])
def test_what_is_read_of_a_damaged_recording_was_recorded(sound, cases, tmp_path, how):
    """Message by message and byte by byte; what is missing is told."""
    wrong: list[str] = []
    read = whole = 0
    originals = {run.name: (open_run(run), told_by(open_run(run))) for run in sound}
    chunks = {run.name: chunks_of(run) for run in sound}
    for number, case in enumerate(cases):
        place = tmp_path / str(number)
        place.mkdir()
        path = case.make(place)
        to_keep: list[Told] = []
        if case.is_ours:
            recorded, messages = originals[path.name]
            damaged = mcap_of(path).read_bytes()
            # Where bytes of an attachment are gone, the length of it reaches into the first chunk, which is not searched: an
            # attachment may hold a recording.
            certain = chunks[path.name][bool(re.search("sector .* is gone", case.name)) :]
            to_keep = [each for chunk, inside in certain if chunk in damaged for each in inside]
        try:
            if how == "recover":
                found = recover(path, tmp_path / "out", lambda _: None)
                run = open_run(found.path)
                told = told_by(run)
                assert run.is_complete == found.is_complete, case.name
                assert found.messages == len(told), case.name
                # Whatever is damaged costs what is in it, and nothing of the chunks that are still there.
                if not is_part_of(to_keep, told):
                    wrong.append(f"{case.name}: {len(told)} messages recovered, {len(to_keep)} are in sound chunks")
            else:
                run = open_run(path, skip_corrupt=how == "open and skip")
                told = told_by(run)
            if case.is_ours:
                problem = untrue(run, told, recorded, messages, recorded.path)
                wrong += [f"{case.name}: {problem}"] if problem else []
            read += 1
            whole += run.is_complete
        except BadInput as error:
            if "\n" in str(error) or (how == "recover" and to_keep):
                wrong.append(f"{case.name}: {error}")
        shutil.rmtree(place)
        shutil.rmtree(tmp_path / "out", ignore_errors=True)
    assert not wrong, "\n".join(wrong)
    assert abs(read - READ[how][0]) <= FEW
    assert abs(whole - READ[how][1]) <= FEW


def test_a_verified_replay_of_a_damaged_recording_never_tells_of_a_difference(sound, cases, tmp_path):
    """It refuses, or says over how many steps it is identical and that the recording is incomplete."""
    steps = len({message[2] for message in told_by(open_run(sound.finished))})
    verified: set[int] = set()
    for number, case in enumerate(cases[::4]):
        # Where a record is taken out of a file without an end, only the numbers of the messages tell, and only recovery
        # looks at them.
        if not case.is_ours or case.name.startswith("killed: the chunk"):
            continue
        place = tmp_path / str(number)
        place.mkdir()
        path = case.make(place)
        for how in ("as it is", "recovered"):
            try:
                run = path if how == "as it is" else recover(path, place / "out", lambda _: None).path
                found = verification_of(run)
                assert found.difference is None, (case.name, how)
                assert found.steps == steps or not open_run(run).is_complete, (case.name, how)
                verified.add(found.steps)
            except BadInput as error:
                assert "\n" not in str(error)
        shutil.rmtree(place)
    assert (min(verified), max(verified), len(verified)) == (0, steps, 5)  # none, all, and up to each lost chunk


COMMANDS: dict[str, tuple[Callable[[Sequence[str]], int], list[str]]] = {
    "verify": (replay, ["--verify"]),
    "what if": (replay, ["--set", "tie_rule=first", "--skip-corrupt"]),
    "report": (report, ["--out", "OUT"]),
    "report, skip": (report, ["--out", "OUT", "--skip-corrupt"]),
    "compare": (compare, ["OTHER"]),
    "recover": (recover_command, ["--out", "OUT"]),
}
EXIT_CODES = {
    "verify": (0, 61, 7),
    "what if": (1, 23, 44),
    "report": (0, 57, 10),
    "report, skip": (0, 17, 50),
    "compare": (1, 47, 19),
    "recover": (25, 7, 35),
}
"""How often each command ends with 0, 2 and 3, of its part of the corpus."""


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_warns_or_refuses_in_one_line(sound, cases, tmp_path, capsys, signal_handlers, command):
    """Exit code 2 and one line more than the warnings, or 3 and warnings; 0 only where nothing is missing."""
    main, options = COMMANDS[command]
    codes: Counter[int] = Counter()
    for number, case in enumerate(cases[list(COMMANDS).index(command) :: len(COMMANDS)]):
        # Of a chunk that is gone from a file without an end only recovery knows.
        if command != "recover" and case.name.startswith("killed: the chunk"):
            continue
        place = tmp_path / str(number)
        place.mkdir()
        path = case.make(place)
        texts = {"OUT": str(place / "out"), "OTHER": str(sound.finished)}
        code = main([str(path), *(texts.get(option, option) for option in options)])
        said = capsys.readouterr().err.splitlines()
        codes[code] += 1
        assert code in (0, 2, 3), case.name
        loud = [line for line in said if not re.match(r"(\w+\.py: )?warning: ", line)]
        assert len(loud) == (code == 2), (case.name, said)
        if command != "recover":  # it prints what is lost
            assert code != 3 or said, case.name
            assert code != 0 or not case.is_ours or open_run(path).is_complete, case.name
        shutil.rmtree(place)
    assert all(abs(codes[code] - count) <= FEW for code, count in zip((0, 2, 3), EXIT_CODES[command], strict=True)), (
        codes
    )


def test_no_damage_takes_more_memory_than_a_chunk(sound, tmp_path):
    """Sizes that are not so, and bombs: in a process that gets little memory, which ends it if it asks for more."""
    code = f"""
import resource, sys
sys.path[:0] = {sys.path!r}
from pathlib import Path
from damaged_recordings import Sound, corpus
from fbql_recording.run import open_run
from fbql_common.core.errors import BadInput
from fbql_recording.recovery.recover import recover
resource.setrlimit(resource.RLIMIT_AS, ({FEW_MIB}, {FEW_MIB}))
done = 0
sound = Sound(*map(Path, {[str(run) for run in sound]!r}))
for case in corpus(sound):
    if "chunk of" in case.name or "chunk is" in case.name or "chunk promises" in case.name or "MiB" in case.name:
        place = Path({str(tmp_path)!r}) / str(done)
        place.mkdir()
        path = case.make(place)
        for read in (
            lambda: list(open_run(path).messages()),
            lambda: list(open_run(path, skip_corrupt=True).messages()),
            lambda: recover(path, place / "out", lambda _: None),
        ):
            try:
                read()
            except BadInput:
                pass
        done += 1
print(done)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=200, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert int(done.stdout) == 15


def test_the_recording_itself_is_never_changed(sound, tmp_path):
    run = Path(shutil.copytree(sound.killed, tmp_path / "run"))
    before = {path: path.read_bytes() for path in run.rglob("*") if path.is_file()}
    found = recover(run, None, lambda _: None)
    assert {path: path.read_bytes() for path in run.rglob("*") if path.is_file()} == before
    assert found.path == tmp_path / "run_recovered"
    assert recover(run, None, lambda _: None).path == tmp_path / "run_recovered2"
    with pytest.raises(BadInput, match="run_recovered exists"):
        recover(run, found.path, lambda _: None)
    assert mcap_of(found.path).name == "run_recovered_0.mcap"
