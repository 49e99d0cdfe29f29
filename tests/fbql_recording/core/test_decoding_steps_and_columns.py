"""What a recording is read by: fields from schemas, bytes by fields, messages joined to steps, steps to episodes and columns."""

from __future__ import annotations

import numpy as np
import pytest
from fbql_common.core.cdr import Codec, Malformed
from fbql_common.core.errors import BadInput
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_recording.core.columns import BLOCK_STEPS, Recorded, columns_of, flat
from fbql_recording.core.decoding import MessageCodec
from fbql_recording.core.episodes import episodes_of
from fbql_recording.core.ros2msg import fields_of
from fbql_recording.core.steps import Step, StepData, StepJoin, key_of
from hypothesis import example, given
from hypothesis import strategies as st
from places import ROOT

MESSAGES = ROOT / "ros2_ws" / "src" / "fbql_msgs" / "msg"
LINE = "=" * 80
HEADER = f"""
{LINE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp  # when
string frame_id
{LINE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
COMMAND = (MESSAGES / "WheelCommand.msg").read_text() + HEADER


# Schemas


def test_fields_of_contained_messages_stand_in_their_place():
    assert [tuple(field) for field in fields_of("fbql_msgs/msg/WheelCommand", COMMAND)] == [
        ("header.stamp.sec", "int32"),
        ("header.stamp.nanosec", "uint32"),
        ("header.frame_id", "string"),
        ("episode", "int64"),
        ("step", "int64"),
        ("left_rad_s", "float64"),
        ("right_rad_s", "float64"),
    ]


def test_constants_comments_defaults_and_bounds_are_no_fields():
    schema = f"""# int64 not_this
int8 K=3
string WORD = "int64 nor_this"
string<=8 text "a # b"
float32[<=4] some
uint16[2] pair [1, 2]
byte b 7
B[2] each
{LINE}
MSG: pkg/B
bool x
"""
    assert [tuple(field) for field in fields_of("pkg/msg/A", schema)] == [
        ("text", "string"),
        ("some", "sequence<float32>"),
        ("pair[0]", "uint16"),
        ("pair[1]", "uint16"),
        ("b", "uint8"),
        ("each[0].x", "bool"),
        ("each[1].x", "bool"),
    ]


def doubling(times: int, text: str = "") -> str:
    """A message that holds another so often, which holds another so often, and the last one nothing."""
    parts = [f"A{depth}[{times}] x\n{LINE}\nMSG: pkg/A{depth}\n" for depth in range(6)]
    return "".join(parts) + text


def test_every_primitive_type_of_ros_is_read():
    signed = [f"int{bits}" for bits in (8, 16, 32, 64)]
    kinds = ["bool", "float32", "float64", "string", *signed, *(f"u{kind}" for kind in signed)]
    schema = "\n".join(f"{kind} f_{kind}" for kind in [*kinds, "byte", "char"])
    assert [field.kind for field in fields_of("pkg/msg/A", schema)] == [*kinds, "uint8", "uint8"]


@pytest.mark.parametrize(
    ("schema", "says"),
    [
        ("Other x", "no definition of pkg/Other"),
        ("A x", "nests pkg/A more than 8 deep"),
        ("A[] x", "type A\\[\\], which is not supported"),
        ("float64[5000] x", "5000 values; at most 4096"),
        ("float64[4096] x\nfloat64 y", "more than 4096 fields"),
        (f"float64[{'9' * 5000}] x", "9{20} values; at most 4096"),
        (doubling(4096), "has more than 4194304 characters"),
        (doubling(4096, f"# {'x' * 10**6}"), "has more than 4194304 characters"),
    ],
    ids=range(8),
)
def test_a_schema_that_cannot_be_read_is_one_line(schema, says):
    with pytest.raises(BadInput, match=says):
        fields_of("pkg/msg/A", schema)


def nested(depth: int) -> str:
    """A message that holds others, each in the one before it, and a number in the last."""
    parts = [f"A{k} x\n{LINE}\nMSG: pkg/A{k}\n" for k in range(depth)]
    return "".join(parts) + "bool y"


def test_a_schema_is_read_up_to_each_limit_and_not_beyond():
    assert len(fields_of("pkg/msg/A", "float64[4096] x")) == 4096
    assert [field.name for field in fields_of("pkg/msg/A", nested(8))] == ["x." * 8 + "y"]
    with pytest.raises(BadInput, match="nests pkg/A8 more than 8 deep"):
        fields_of("pkg/msg/A", nested(9))
    visit = 80  # counts for each message in addition to its text
    longest = "bool x\n#".ljust(2**22 - visit, "z")
    assert len(fields_of("pkg/msg/A", longest)) == 1
    with pytest.raises(BadInput, match="has more than 4194304 characters"):
        fields_of("pkg/msg/A", longest + "z")


# Messages


def command_at(episode: int, step: int) -> WheelCommand:
    return WheelCommand(10**9 * episode + 10**7 * step, episode, step, 1.5, -2.5)


def test_a_message_of_ours_is_decoded_and_encoded_to_the_same_bytes():
    codec = MessageCodec[WheelCommand]("fbql_msgs/msg/WheelCommand", COMMAND)
    data = codec.encode(command_at(3, 4))
    assert codec.is_ours
    assert codec.decode(data) == command_at(3, 4)
    assert key_of(data) == command_at(3, 4)[:3]


def test_a_message_of_another_version_gives_its_own_fields_in_our_order():
    schema = """float32 extra
float64 right_rad_s
std_msgs/Header header
int32 step
float64 left_rad_s
int64 episode
string[] words
"""
    codec = MessageCodec[WheelCommand]("fbql_msgs/msg/WheelCommand", schema + HEADER)
    data = Codec(
        ["float32", "float64", "int32", "uint32", "string", "int32", "float64", "int64", "sequence<string>"]
    ).encode([0.5, -2.5, 7, 8, "field", 4, 1.5, 3, ("a", "b")])
    assert codec.decode(data) == WheelCommand(7 * 10**9 + 8, 3, 4, 1.5, -2.5)
    assert not codec.is_ours
    with pytest.raises(TypeError, match="other fields than ours"):
        codec.encode(command_at(0, 0))


@pytest.mark.parametrize(
    ("values", "says"),
    [
        ([7, 8, "map", 3, 4, 0.0, 0.0], "frame_id is 'map', expected 'field'"),
        ([-1, 8, "field", 3, 4, 0.0, 0.0], "is not a valid time"),
        ([7, 10**9, "field", 3, 4, 0.0, 0.0], "is not a valid time"),
    ],
)
def test_a_message_that_is_none_of_ours_is_malformed(values, says):
    data = Codec(["int32", "uint32", "string", "int64", "int64", "float64", "float64"]).encode(values)
    with pytest.raises(Malformed, match=says):
        MessageCodec[WheelCommand]("fbql_msgs/msg/WheelCommand", COMMAND).decode(data)


def test_a_field_with_a_default_may_be_missing_and_any_other_is_named():
    """Recordings of earlier releases lack the learned weights."""
    whole = (MESSAGES / "FusionDecision.msg").read_text() + HEADER
    older = "\n".join(line for line in whole.splitlines() if " learned_weights" not in line)
    assert older != whole.rstrip("\n")
    codec = MessageCodec[Decision]("fbql_msgs/msg/FusionDecision", older)
    assert not codec.is_ours
    with pytest.raises(BadInput, match=r"lacks the field reward, which is needed"):
        without = "\n".join(line for line in whole.splitlines() if " reward" not in line)
        MessageCodec[Decision]("fbql_msgs/msg/FusionDecision", without)


def test_a_field_that_an_older_recording_lacks_has_its_default():
    whole = (MESSAGES / "FusionDecision.msg").read_text() + HEADER
    older = "\n".join(line for line in whole.splitlines() if " learned_weights" not in line)
    codec = MessageCodec[Decision]("fbql_msgs/msg/FusionDecision", older)
    assert codec.missing == {"learned_weights"}
    decision = Decision(0, 3, 4, "fbql", 1, BEHAVIORS, (5, 6), (0.5, -0.5), (1.0, 0.0), 0, -5.0, True)
    data = Codec([field.kind for field in fields_of("fbql_msgs/msg/FusionDecision", older)])
    assert codec.decode(data.encode([0, 0, "field", *decision[1:-1]])) == decision
    newer = MessageCodec[Decision]("fbql_msgs/msg/FusionDecision", whole)
    assert newer.missing == frozenset()
    told = decision._replace(stamp_ns=10**9 - 1, learned_weights=(0.25, 0.75))
    assert newer.decode(newer.encode(told)) == told


def test_a_key_needs_the_whole_head_of_a_message_in_our_frame():
    data = MessageCodec[WheelCommand]("fbql_msgs/msg/WheelCommand", COMMAND).encode(command_at(3, 4))
    head = 4 + 40
    assert key_of(data[:head]) == command_at(3, 4)[:3]
    assert key_of(data[: head - 1]) is None
    assert key_of(b"\0\0" + data[2:]) is None
    assert key_of(data.replace(b"field\0", b"world\0")) is None


@given(st.binary(max_size=60))
def test_no_bytes_are_taken_for_a_key_by_mistake(data):
    """`key_of` reads the head alone: it agrees with the whole message wherever that can be decoded."""
    codec = MessageCodec[WheelCommand]("fbql_msgs/msg/WheelCommand", COMMAND)
    try:
        decoded = codec.decode(data)
    except Malformed:
        return
    assert key_of(data) == decoded[:3]


# Steps


WINDOW = 16
"""Newer steps that have begun, after which a step is no longer waited for."""


def joined(arrival: list[tuple[int, int]], messages: int) -> tuple[list[StepData], int]:
    """The steps that come of messages (step, place) in this order, and how many messages were left out."""
    join = StepJoin(messages)
    out: list[StepData] = []
    for step, place in arrival:
        join.add(place, (step, 0, step), bytes([step, place]))
        out += join.ready()
    out += join.rest()
    return out, join.repeated


def delayed(delays: list[int], messages: int) -> list[tuple[int, int]]:
    """The messages of 60 steps, each late by so many others."""
    sent = [(step, place) for step in range(60) for place in range(messages)]
    return [sent[i] for i in sorted(range(len(sent)), key=lambda i: i + delays[i % len(delays)])]


def within_the_window(arrival: list[tuple[int, int]]) -> dict[int, set[int]]:
    """The places of each step that must be kept, from the rule alone: fewer than WINDOW newer steps have begun between
    the step's first message and this one."""
    began: dict[int, int] = {}
    for index, (step, _) in enumerate(arrival):
        began.setdefault(step, index)
    kept: dict[int, set[int]] = {}
    for index, (step, place) in enumerate(arrival):
        newer = [other for other, first in began.items() if other > step and began[step] < first < index]
        if len(newer) < WINDOW:
            kept.setdefault(step, set()).add(place)
    return kept


@given(st.lists(st.integers(0, 120), min_size=17, max_size=17), st.integers(3, 6))
@example(delays=[2, 0, 0, 38, 0, 0, 0, 0, 0, 10, 9, 8, 7, 6, 5, 4, 3], messages=3)
def test_a_message_is_kept_until_as_many_newer_steps_as_the_window_have_begun(delays, messages):
    arrival = delayed(delays, messages)
    out, repeated = joined(arrival, messages)
    assert [step.step for step in out] == list(dict.fromkeys(step for step, _ in arrival))
    got = {step.step: {place for place in range(messages) if step.data[place]} for step in out}
    for step, places in within_the_window(arrival).items():
        assert places <= got[step], f"step {step} lost a message"
    for step in out:
        assert all(data in (b"", bytes([step.step, place])) for place, data in enumerate(step.data))
    assert sum(map(len, got.values())) + repeated == len(arrival)


def test_older_steps_that_come_late_do_not_shorten_the_window():
    older = [(step, place) for step in range(1, 40) for place in (0, 1)]
    newer = [(step, place) for step in range(51, 50 + WINDOW) for place in (0, 1)]
    out, repeated = joined([(50, 0), *older, *newer, (50, 1)], 2)
    assert next(step.data for step in out if step.step == 50) == [bytes([50, 0]), bytes([50, 1])]
    assert repeated == 0


def test_a_step_is_no_longer_waited_for_when_as_many_newer_ones_as_the_window_have_begun():
    join = StepJoin(2)
    for step in range(WINDOW):
        join.add(0, (step, 0, step), b"a")
        assert list(join.ready()) == []
    join.add(0, (WINDOW, 0, WINDOW), b"a")
    assert [step.step for step in join.ready()] == [0]


def test_steps_whose_time_only_goes_backward_are_not_collected_without_end():
    join = StepJoin(2)
    waiting = [0]
    for step in range(5000, 0, -1):
        join.add(0, (step, 0, step), b"a")
        waiting.append(waiting[-1] + 1 - len(list(join.ready())))
    assert max(waiting) == 256


def test_a_second_message_of_a_kind_is_left_out_and_counted_even_when_it_is_late():
    join = StepJoin(2)
    for data in (b"first", b"again"):
        join.add(0, (1, 0, 1), data)
    join.add(1, (1, 0, 1), b"b")
    assert [step.data for step in join.ready()] == [[b"first", b"b"]]
    join.add(0, (1, 0, 1), b"late")
    assert list(join.rest()) == []
    assert join.repeated == 2


def test_a_message_that_comes_again_is_known_for_256_steps():
    join = StepJoin(1)
    for step in range(257):
        join.add(0, (step, 0, step), b"a")
    assert len(list(join.ready())) == 257
    join.add(0, (1, 0, 1), b"again")
    assert (list(join.ready()), join.repeated) == ([], 1)
    join.add(0, (0, 0, 0), b"too late to be known")
    assert [step.step for step in join.ready()] == [0]
    assert join.repeated == 1


def test_a_step_that_lacks_a_message_comes_out_when_newer_ones_have_begun():
    join = StepJoin(2)
    out: list[int] = []
    for step in range(20):
        join.add(0, (step, 0, step), b"a")
        if step != 1:
            join.add(1, (step, 0, step), b"b")
        out += [each.step for each in join.ready()]
        if step == 10:
            assert out == [0], "step 1 is waited for"
    out += [each.step for each in join.rest()]
    assert out == list(range(20))


def test_an_episode_that_begins_again_may_have_the_same_steps_again():
    join = StepJoin(1)
    join.add(0, (1, 0, 0), b"a")
    out = list(join.ready())
    out += join.rest()
    join.mark_next(begins_again=True, after_gap=False)
    join.add(0, (1, 0, 0), b"a")
    join.add(0, (2, 0, 1), b"b")
    out += join.rest()
    assert [(step.step, step.begins_again) for step in out] == [(0, False), (0, True), (1, False)]
    assert join.repeated == 0


def test_the_step_after_a_gap_says_so():
    join = StepJoin(1)
    join.mark_next(begins_again=False, after_gap=True)
    for step in range(2):
        join.add(0, (step, 0, step), b"a")
    assert [(step.step, step.after_gap, step.begins_again) for step in join.rest()] == [
        (0, True, False), (1, False, False),
    ]  # fmt: skip


# Episodes and columns

BEHAVIORS = ("a", "b")


def world_at(episode: int, step: int, **fields: bool) -> World:
    stamp_ns = 10**9 * episode + 10**7 * step
    return World(stamp_ns, episode, step, *(0.5 * number for number in range(12)), *[False] * 6)._replace(**fields)


def step_at(episode: int, step: int, reward: float = 0.0, **fields: bool) -> Step:
    world = world_at(episode, step, **fields)
    outputs = (
        BehaviorOutput(*world[:3], "a", 1.0, 2.0, 3, 9, "h", False, (0.25,)),
        None if step == 1 else BehaviorOutput(*world[:3], "b", 1.0, 2.0, 4, 9, "h", True, (0.5, 0.75)),
    )
    decision = Decision(
        *world[:3], "x", 1, BEHAVIORS, (3, -1 if step == 1 else 4), (), (0.25, 0.75), -1, reward, step == 1
    )
    return Step(*world[:3], world, outputs, WheelCommand(*world[:3], 5.0, 6.0), decision)


def test_an_episode_counts_what_happened_in_it():
    steps = [step_at(4, 0), step_at(4, 1, -5.0, collision_begun=True, collision=True), step_at(4, 2, collision=True)]
    steps.append(step_at(4, 3, 10.0, terminated=True, goal=True))
    (episode,) = episodes_of(steps)
    assert (episode.index, episode.outcome, episode.steps, episode.recorded_steps) == (4, "goal", 3, 4)
    assert (episode.collisions_begun, episode.collision_steps, episode.return_) == (1, 2, 5.0)
    assert (episode.phase, episode.degraded) == ("learning", True)
    assert (episode.begin_ns, episode.end_ns) == (4 * 10**9, 4 * 10**9 + 3 * 10**7)


def test_an_episode_without_a_reward_or_a_contact_has_none_of_either():
    (episode,) = episodes_of([step_at(0, 0), step_at(0, 2, terminated=True, own_goal=True)])
    assert (episode.collisions_begun, episode.collision_steps, episode.return_, episode.degraded) == (0, 0, 0.0, False)
    assert (episode.outcome, episode.seed) == ("own_goal", None)


def test_an_episode_that_is_restarted_or_whose_step_comes_again_begins_anew():
    steps = [step_at(0, 0), step_at(0, 0), step_at(0, 1), step_at(0, 2)._replace(begins_again=True)]
    assert [(e.first_step, e.recorded_steps, e.steps) for e in episodes_of(steps)] == [(0, 1, 0), (1, 2, 1), (3, 1, 2)]


def test_episodes_end_with_the_next_ones_beginning():
    steps = [step_at(0, 0), step_at(0, 1), step_at(1, 0), step_at(1, 1), step_at(1, 0), step_at(1, 1, truncated=True)]
    assert [(e.index, e.first_step, e.recorded_steps, e.outcome) for e in episodes_of(steps)] == [
        (0, 0, 2, None),
        (1, 2, 2, None),
        (1, 4, 2, "timeout"),
    ]


def test_what_was_not_recorded_of_an_episode_is_none():
    (episode,) = episodes_of([Step(1, 0, 0, None, (None, None), None, None)])
    assert (episode.collisions_begun, episode.return_, episode.phase, episode.degraded) == (None, None, None, None)


EVERYTHING = Recorded(True, BEHAVIORS, True, True, True)


def test_columns_are_the_same_whatever_the_blocks():
    steps = [step_at(0, step) for step in range(BLOCK_STEPS + 3)]
    columns = columns_of(steps, EVERYTHING)
    assert {len(column) for column in columns.values()} == {BLOCK_STEPS + 3}
    assert columns["step"].tolist() == list(range(BLOCK_STEPS + 3))
    assert columns["robot_y_m"].tolist() == [0.5] * (BLOCK_STEPS + 3)
    assert columns["weights"].shape == (BLOCK_STEPS + 3, 2)


def test_an_answer_that_is_missing_is_minus_one_and_nan():
    columns = columns_of([step_at(0, step) for step in range(3)], EVERYTHING)
    assert columns["leaf_id"].tolist() == [[3, 4], [3, -1], [3, 4]]
    assert np.isnan(columns["reference_left_rad_s"]).tolist() == [[False] * 2, [False, True], [False] * 2]
    assert np.isnan(columns["observation.b"]).tolist() == [[False] * 2, [True] * 2, [False] * 2]
    assert np.isnan(columns["q"]).all(), "nothing was learned"


def test_a_step_of_which_nothing_is_recorded_has_a_row_that_says_so():
    empty = Step(7, 0, 1, None, (None, None), None, None)
    columns = columns_of([step_at(0, 0), empty, step_at(0, 1)], EVERYTHING)
    for name in ("has_world", "has_command", "has_decision"):
        assert columns[name].tolist() == [True, False, True], name
    for name in ("robot_x_m", "ball_vy_m_s", "wall_yaw_rad", "command_left_rad_s", "command_right_rad_s", "reward"):
        assert np.isnan(columns[name]).tolist() == [False, True, False], name
    for name in ("q", "weights", "learned_weights", "observation.a", "reference_right_rad_s"):
        assert np.isnan(columns[name][1]).all(), name
    for name in ("goal", "own_goal", "collision", "collision_begun", "terminated", "truncated"):
        assert columns[name].tolist() == [False] * 3, name
    assert (columns["phase"].tolist(), columns["driver"].tolist()) == ([1, -1, 1], [-1, -1, -1])
    assert columns["joint_state"].tolist() == [[3, 4], [-1, -1], [3, -1]]
    assert columns["degraded"].tolist() == [False, False, True]
    assert columns["clamped"].tolist() == [[False, True], [False, False], [False, False]]
    assert (columns["command_left_rad_s"][0], columns["command_right_rad_s"][0]) == (5.0, 6.0)
    assert columns["reference_left_rad_s"][0].tolist() == [1.0, 1.0]
    assert columns["reference_right_rad_s"][0].tolist() == [2.0, 2.0]


def test_observations_that_a_block_lacks_are_as_wide_as_those_of_the_others():
    silent = [Step(step, 0, step, None, (None, None), None, None) for step in range(BLOCK_STEPS)]
    columns = columns_of([*silent, step_at(0, 0)], EVERYTHING)
    assert columns["observation.a"].shape == (BLOCK_STEPS + 1, 1)
    assert columns["observation.b"].shape == (BLOCK_STEPS + 1, 2)
    assert np.isnan(columns["observation.b"][:-1]).all()
    assert columns["observation.b"][-1].tolist() == [0.5, 0.75]


def test_without_any_answer_an_observation_has_no_columns():
    columns = columns_of([Step(1, 0, 0, None, (None, None), None, None)], EVERYTHING)
    assert columns["observation.a"].shape == (1, 0)
    assert flat(columns, BEHAVIORS).keys() >= {"leaf_id.a", "leaf_id.b"}
    assert not [name for name in flat(columns, BEHAVIORS) if name.startswith("observation.")]


def test_without_any_step_the_columns_are_there_and_empty():
    columns = columns_of([], EVERYTHING)
    assert {name: column.shape for name, column in columns.items() if len(column)} == {}
    assert columns["weights"].shape == columns["leaf_id"].shape == (0, 2)
    assert columns["robot_x_m"].shape == columns["goal"].shape == (0,)


def test_topics_that_are_not_recorded_have_no_columns():
    columns = columns_of([step_at(0, 0)], Recorded(True, BEHAVIORS, False, True, False))
    assert "robot_x_m" in columns and "command_left_rad_s" in columns
    assert not {"leaf_id", "weights", "reward", "has_decision", "observation.a"} & columns.keys()


def test_flat_columns_are_named_by_behavior():
    columns = flat(columns_of([step_at(0, 0)], EVERYTHING), BEHAVIORS)
    assert {column.ndim for column in columns.values()} == {1}
    assert columns["weights.b"].tolist() == [0.75]
    assert (columns["step"].tolist(), columns["phase"].tolist()) == ([0], [1])
    assert columns["observation.b.1"].tolist() == [0.75]
