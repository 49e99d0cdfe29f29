"""metadata.yaml and its files agree, or the reader says where they do not."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from fbql_common.core.errors import BadInput
from fbql_recording.recovery.recover import recover
from fbql_recording.run import open_run
from recorded_match import record_match

STEPS = 2 * 7
MESSAGES = 6 * STEPS


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two episodes of seven steps. Not to be changed."""
    return record_match(tmp_path_factory.mktemp("recorded") / "run", max_steps=6, episodes=2)


@pytest.fixture
def edited(recorded: Path, tmp_path: Path) -> Callable[[Callable[[dict[str, Any]], object]], Path]:
    """A copy with its metadata changed."""

    def edit(change: Callable[[dict[str, Any]], object]) -> Path:
        run = Path(shutil.copytree(recorded, tmp_path / "run"))
        document = yaml.safe_load((run / "metadata.yaml").read_text())
        change(document["rosbag2_bagfile_information"])
        (run / "metadata.yaml").write_text(yaml.safe_dump(document))
        return run

    return edit


def set_topic(name: str, value: object) -> Callable[[dict[str, Any]], object]:
    return lambda information: information["topics_with_message_count"][0].update({name: value})


def set_about(name: str, value: object) -> Callable[[dict[str, Any]], object]:
    return lambda information: information["topics_with_message_count"][0]["topic_metadata"].update({name: value})


def set_file(name: str, value: object) -> Callable[[dict[str, Any]], object]:
    return lambda information: information["files"][0].update({name: value})


def replace(**changes: object) -> Callable[[dict[str, Any]], object]:
    return lambda information: information.update(changes)


def test_what_agrees_has_no_warning(recorded):
    run = open_run(recorded)
    assert (run.warnings, run.is_complete) == ([], True)


SAID = {
    "more messages": (replace(message_count=MESSAGES + 1), f"all topics: {MESSAGES + 1} messages, but there are", False),
    "fewer messages": (replace(message_count=1), "all topics: 1 messages, but there are", True),
    "negative": (replace(message_count=-5), "message_count is -5; not used", True),
    "no number": (replace(message_count="many"), "message_count is 'many'; not used", True),
    "a fraction": (replace(message_count=1.5), "message_count is 1.5; not used", True),
    "a list of numbers": (replace(message_count=[1]), "message_count is [1]; not used", True),
    "true": (replace(message_count=True), "message_count is True; not used", True),
    "a topic with more": (set_topic("message_count", 99), "topic /world: 99 messages, but there are", False),
    "a topic with less": (set_topic("message_count", 1), "topic /world: 1 messages, but there are", True),
    "a topic's negative": (set_topic("message_count", -1), "topic /world: message_count is -1; not used", True),
    "another type": (set_about("type", "std_msgs/msg/String"), "topic /world: type std_msgs/msg/String, but", True),
    "a type that is none": (set_about("type", 3), "a topic without a name or type", True),
    "another topic": (set_about("name", "/other"), "topic /other: 14 messages, but there are 0", False),
    "no topic": (set_topic("topic_metadata", None), "a topic without a name or type", True),
    "an odd topic": (lambda i: i["topics_with_message_count"].append(3), "topics_with_message_count has 3", True),
    "a topic twice": (
        lambda i: i["topics_with_message_count"].append(i["topics_with_message_count"][0]), "topic /world is there twice", True,
    ),
    "a topic less": (lambda i: i["topics_with_message_count"].pop(0), "topic /world: not there", True),
    "a file with more": (set_file("message_count", 99), "file run_0.mcap: 99 messages", False),
    "another file": (set_file("path", "other.mcap"), "other.mcap, which is not among relative_file_paths", True),
    "a file without a path": (set_file("path", None), "a file without a path", True),
    "a file that is none": (replace(files=[[]]), "files has []", True),
    "another start": (replace(starting_time={"nanoseconds_since_epoch": 7}), "starting_time: 7 ns, but it is", True),
    "a start that is none": (replace(starting_time="noon"), "nanoseconds_since_epoch is 'noon'; not used", True),
    "another duration": (replace(duration={"nanoseconds": 7}), "duration: 7 ns, but it is", True),
    "a negative duration": (replace(duration={"nanoseconds": -7}), "duration: nanoseconds is -7; not used", True),
    "a file twice": (replace(relative_file_paths=["run_0.mcap", "run_0.mcap"]), "names run_0.mcap twice", True),
    "a file by two names": (replace(relative_file_paths=["run_0.mcap", "./run_0.mcap"]), "twice; it is read once", True),
}  # fmt: skip


@pytest.mark.parametrize("what", SAID)
def test_what_disagrees_is_said_in_a_line_and_the_files_are_read(edited, what):
    change, says, is_complete = SAID[what]
    path = edited(change)
    run = open_run(path)
    assert [line for line in run.warnings if says in line], run.warnings
    assert run.is_complete == is_complete
    assert sum(1 for _ in run.messages()) == MESSAGES
    assert recover(path, None).messages == MESSAGES


@pytest.mark.parametrize(
    "change", [replace(storage_identifier=""), replace(storage_identifier=None), lambda i: i.pop("files")]
)
def test_a_reindexed_bag_is_read(edited, change):
    run = open_run(edited(change))
    assert (run.warnings, run.is_complete, sum(run.counts.values())) == ([], True, MESSAGES)


@pytest.mark.parametrize(
    "change",
    [
        replace(storage_identifier="sqlite3"),
        replace(storage_identifier=[1]),
        replace(topics_with_message_count=3),
        replace(topics_with_message_count={"a": "b"}),
        replace(files="run_0.mcap"),
        replace(relative_file_paths="run_0.mcap"),
        replace(relative_file_paths=[["run_0.mcap"]]),
        replace(relative_file_paths=[1]),
        replace(relative_file_paths=None),
        replace(relative_file_paths=["x" * 300]),
        replace(relative_file_paths=["\ud800".encode("utf-8", "replace").decode(), "a\nb"]),
    ],
)
def test_what_names_no_recording_is_one_line(edited, change):
    with pytest.raises(BadInput, match=r"metadata\.yaml|leads out|File name too long"):
        open_run(edited(change))


def test_a_damaged_recording_is_not_accused_twice(edited):
    path = edited(replace())
    file = path / "run_0.mcap"
    file.write_bytes(file.read_bytes()[:-20])
    assert [line for line in open_run(path).warnings if "metadata" in line] == []
