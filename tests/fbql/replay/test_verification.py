"""`replay.py RUN --verify`: what was recorded is computed again to the last bit, or the first step that differs is named."""

from __future__ import annotations

import json
import math
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import yaml
from commands import replay as main
from damaged_recordings import mcap_of, places_of, spoil
from fbql.replay.recomputation import RecordedBehaviors, recorded_parameters, recorded_trees
from fbql.replay.verification import verify as verify_steps
from fbql_common.wire import (
    decode_command,
    decode_decision,
    decode_output,
    decode_world,
    encode_command,
    encode_decision,
    encode_output,
    encode_world,
)
from fbql_fusion.core.controllers.parameters import CONTROLLERS
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_recording.recovery.recover import recover
from fbql_recording.run import open_run
from fuzzing import finite_json
from mcap.opcode import Opcode
from places import ROOT
from recorded_match import TREES, digest_of, record_match
from rewritten_run import rewrite

LEARNING = {"controller": "fbql_literal", "guided": 1, "tie_rule": "random"}
"""With a random stream of its own, and a guided episode."""


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three episodes, one of them guided. Not to be changed."""
    return record_match(tmp_path_factory.mktemp("recorded") / "run", max_steps=200, **LEARNING)


def verify(run: Path, capsys: pytest.CaptureFixture[str], *options: str) -> tuple[int, dict[str, Any]]:
    code = main([str(run), "--verify", "--json", *options])
    return code, finite_json(capsys.readouterr().out)


def is_identical(run: Path, capsys: pytest.CaptureFixture[str], *options: str) -> int:
    """Asserts that every step is; gives their number."""
    code, found = verify(run, capsys, *options)
    assert (code, found["identical"], found["first_difference"]) == (0, True, None)
    assert found["steps"] == sum(1 for _ in open_run(run).steps()) > 0
    assert found["digest"] == digest_of(run)
    assert found["not_recomputed"] == {}
    return found["steps"]


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_a_run_of_every_controller_is_identical(tmp_path, capsys, controller):
    is_identical(record_match(tmp_path / "run", controller=controller, guided=1), capsys)


@pytest.mark.parametrize("tie_rule", ["none", "first", "all", "random"])
def test_a_run_that_learns_is_identical_whoever_wins_a_tie(tmp_path, capsys, tie_rule):
    is_identical(record_match(tmp_path / "run", controller="fbql_literal", guided=1, tie_rule=tie_rule), capsys)


def test_a_run_that_starts_from_a_policy_is_identical(recorded, tmp_path, capsys):
    policy = Path(shutil.copyfile(recorded / "policy.npz", tmp_path / "policy.npz"))
    run = record_match(tmp_path / "run", policy=policy, **(LEARNING | {"guided": -1}))
    policy.unlink()
    is_identical(run, capsys)


def test_a_run_in_which_a_behavior_was_missing_is_identical(tmp_path, capsys):
    def hear(world, outputs):
        gone = {7: [1], 8: [1], 20: [0, 1, 2]}.get(world.step, [])
        return [None if i in gone else output for i, output in enumerate(outputs)]

    run = record_match(tmp_path / "run", hear=hear, **LEARNING)
    assert all(episode.degraded for episode in open_run(run).episodes())
    is_identical(run, capsys)


@pytest.mark.parametrize("first", [0, 12])
def test_a_run_in_which_an_episode_began_again_is_identical(tmp_path, capsys, first):
    run = record_match(tmp_path / "run", restart_at={1: (8, first)}, max_steps=30, **LEARNING)
    assert len(open_run(run).episodes()) == 4
    is_identical(run, capsys)


def test_a_file_alone_is_identical(recorded, tmp_path, capsys):
    alone = Path(shutil.copyfile(recorded / "run_0.mcap", tmp_path / "alone.mcap"))
    code, found = verify(alone, capsys)
    assert (code, found["identical"]) == (0, True)


def test_the_words_say_how_many_steps(recorded, capsys):
    assert main([str(recorded), "--verify"]) == 0
    steps = sum(1 for _ in open_run(recorded).steps())
    assert capsys.readouterr().out.startswith(f"identical over {steps} steps (")


# What differs


def changed_field(topic: str, at: tuple[int, int], name: str, value: Callable[[Any], Any]) -> Callable[[Any], bytes]:
    """Changes one field of one message."""
    codecs: Any = {
        "/world": (decode_world, encode_world),
        "/behaviors/wall_avoiding": (decode_output, encode_output),
        "/wheel_command": (decode_command, encode_command),
        "/fusion/decision": (decode_decision, encode_decision),
    }
    decode, encode = codecs[topic]

    def change(message: Any) -> bytes:
        if message.topic != topic:
            return message.data
        decoded = decode(message.data)
        if (decoded.episode, decoded.step) != at:
            return message.data
        return encode(decoded._replace(**{name: value(getattr(decoded, name))}))

    return change


def next_float(value: float) -> float:
    return math.nextafter(value, math.inf)


@pytest.mark.parametrize(
    ("topic", "name", "value", "what"),
    [
        ("/fusion/decision", "weights", lambda w: (w[0], next_float(w[1]), w[2]), "weights of the decision"),
        ("/fusion/decision", "q", lambda q: (q[0], q[1], next_float(q[2])), "q of the decision"),
        ("/fusion/decision", "q", lambda q: (q[0], math.nan, q[2]), "q of the decision"),
        ("/fusion/decision", "joint_state", lambda s: (s[0] + 1, *s[1:]), "joint_state of the decision"),
        ("/fusion/decision", "degraded", lambda d: not d, "degraded of the decision"),
        ("/wheel_command", "left_rad_s", next_float, "left_rad_s of the command"),
        ("/behaviors/wall_avoiding", "leaf_id", lambda leaf: leaf ^ 1, "leaf_id of the answer of wall_avoiding"),
        ("/behaviors/wall_avoiding", "right_rad_s", next_float, "right_rad_s of the answer of wall_avoiding"),
    ],
)
def test_the_step_and_the_field_that_differ_are_named(recorded, tmp_path, capsys, topic, name, value, what):
    run = rewrite(recorded, tmp_path / "run", changed_field(topic, (2, 31), name, value))
    code, found = verify(run, capsys)
    difference = found["first_difference"]
    assert (code, found["identical"]) == (1, False)
    assert (difference["episode"], difference["step"], difference["what"]) == (2, 31, what)
    assert difference["recorded"] != difference["recomputed"]
    steps = [(step.episode, step.step) for step in open_run(run).steps()]
    assert found["steps"] == difference["index"] == steps.index((2, 31))
    assert main([str(run), "--verify"]) == 1
    assert "differs: episode 2, step 31 (at " in capsys.readouterr().out


def test_a_sign_of_zero_is_a_difference(recorded, tmp_path, capsys):
    last = open_run(recorded).episodes()[0].steps
    run = rewrite(recorded, tmp_path / "run", changed_field("/wheel_command", (0, last), "left_rad_s", lambda _: -0.0))
    assert verify(run, capsys)[1]["first_difference"]["what"] == "left_rad_s of the command"


def test_another_pose_is_noticed_where_the_behaviors_sense_it(recorded, tmp_path, capsys):
    run = rewrite(recorded, tmp_path / "run", changed_field("/world", (1, 9), "ball_x_m", lambda x: x + 0.01))
    difference = verify(run, capsys)[1]["first_difference"]
    assert (difference["episode"], difference["step"]) == (1, 9)
    assert difference["what"] == "observation of the answer of ball_seeking"


def test_an_answer_that_was_left_out_is_a_difference(recorded, tmp_path, capsys):
    def change(message):
        is_it = message.topic == "/behaviors/wall_avoiding" and decode_output(message.data)[1:3] == (1, 5)
        return None if is_it else message.data

    difference = verify(rewrite(recorded, tmp_path / "run", change), capsys)[1]["first_difference"]
    assert (difference["episode"], difference["step"]) == (1, 5)


@pytest.mark.parametrize("topic", ["/world", "/wheel_command", "/fusion/decision"])
def test_a_message_that_was_left_out_is_a_difference(recorded, tmp_path, capsys, topic):
    decode: Any = {"/world": decode_world, "/wheel_command": decode_command, "/fusion/decision": decode_decision}[topic]

    def change(message):
        is_it = message.topic == topic and (decode(message.data).episode, decode(message.data).step) == (1, 5)
        return None if is_it else message.data

    difference = verify(rewrite(recorded, tmp_path / "run", change), capsys)[1]["first_difference"]
    assert (difference["episode"], difference["step"], difference["what"]) == (1, 5, "messages")


def test_an_episode_that_was_left_out_is_a_difference(recorded, tmp_path, capsys):
    decoders: Any = {"/world": decode_world, "/wheel_command": decode_command, "/fusion/decision": decode_decision}

    def change(message):
        decode = decoders.get(message.topic, decode_output)
        return None if decode(message.data).episode == 1 else message.data

    difference = verify(rewrite(recorded, tmp_path / "run", change), capsys)[1]["first_difference"]
    assert (difference["what"], difference["recorded"]) == ("the schedule", "episode 2")


def test_another_digest_than_that_of_the_summary_is_a_difference(recorded, tmp_path, capsys):
    summary = json.loads((recorded / "summary.json").read_text())
    run = Path(shutil.copytree(recorded, tmp_path / "run"))
    (run / "summary.json").write_text(json.dumps({**summary, "digest": "0" * 64}))
    code, found = verify(run, capsys)
    assert (code, found["first_difference"]["what"]) == (1, "digest")


# What can't be computed again


def test_answers_of_a_tree_that_is_not_recorded_are_taken_as_they_are_and_counted(recorded, tmp_path, capsys):
    run = rewrite(recorded, tmp_path / "run", lambda m: m.data, leave_out=("trees/approaching.json",))
    code, found = verify(run, capsys)
    assert (code, found["identical"]) == (0, True)
    assert found["not_recomputed"] == {"approaching": found["steps"]}
    assert main([str(run), "--verify"]) == 0
    assert "as recorded, not recomputed" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("leave_out", "says"),
    [
        ("config.yaml", "it has no parameters"),
        ("policy_before.npz", "started from a policy that is not in the recording"),
    ],
)
def test_a_recording_that_lacks_what_is_needed_says_so(recorded, tmp_path, capsys, leave_out, says):
    source = record_match(tmp_path / "source", policy=recorded / "policy.npz", **LEARNING)
    run = rewrite(source, tmp_path / "run", lambda message: message.data, leave_out=(leave_out,))
    (run / "config.yaml").unlink()
    assert main([str(run), "--verify"]) == 2
    said = capsys.readouterr().err
    assert says in said
    assert said.count("\n") == 1


def test_a_behavior_of_the_users_own_is_computed_with_the_observation_that_the_user_names(tmp_path, capsys):
    shooting = ROOT / "examples" / "shooting"
    trees = tmp_path / "trees"
    shutil.copytree(TREES, trees)
    shutil.copyfile(shooting / "shooting.json", trees / "shooting.json")
    from fbql_behaviors.observation_loading import load_observation

    source = f"{shooting / 'shooting.py'}:shooting"
    assert load_observation(source).behavior == "shooting"
    run = record_match(
        tmp_path / "run",
        trees=trees,
        behaviors=["ball_seeking", "wall_avoiding", "approaching", "shooting"],
        controller="uniform",
        observations={"shooting": source},
    )
    assert open_run(run).attachments["observations/shooting.py"] == (shooting / "shooting.py").read_bytes()
    code, found = verify(run, capsys)
    assert (code, found["not_recomputed"]) == (0, {"shooting": found["steps"]})
    is_identical(run, capsys, "--observation", source)


# Incomplete recordings


def test_the_complete_part_of_a_run_that_was_killed_is_verified_and_exits_with_3(tmp_path, capsys):
    run = record_match(tmp_path / "run", close=False, **LEARNING)
    code, found = verify(run, capsys)
    assert (code, found["identical"], found["complete"]) == (3, True, False)
    assert found["steps"] > 60
    assert verify(run, capsys, "--allow-incomplete")[0] == 0


def test_damage_is_one_line_with_the_chunk(recorded, tmp_path, capsys):
    run = Path(shutil.copytree(recorded, tmp_path / "run"))
    path = run / "run_0.mcap"
    data = bytearray(path.read_bytes())
    data[len(data) // 2] ^= 1
    path.write_bytes(data)
    assert main([str(run), "--verify"]) == 2
    said = capsys.readouterr().err
    assert "chunk" in said
    assert said.count("\n") == 1


@pytest.mark.parametrize("topic", ["/fusion/decision", "/wheel_command", "/behaviors/wall_avoiding"])
def test_a_message_that_is_none_of_its_type_is_one_line_with_its_step(recorded, tmp_path, capsys, topic):
    messages = 0

    def change(message: Any) -> bytes:
        nonlocal messages
        messages += message.topic == topic
        return message.data[:-3] if message.topic == topic and messages == 20 else message.data

    assert main([str(rewrite(recorded, tmp_path / "run", change)), "--verify"]) == 2
    said = capsys.readouterr().err
    assert "run: episode 0, step 19: " in said
    assert said.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--verify", "--set", "seed=1"], "leave out --set"),
        (["--verify", "--skip-corrupt"], "leave out --skip-corrupt"),
        (["--csv", "x.csv"], "add --set"),
    ],
)
def test_options_that_do_not_go_together_are_one_line(recorded, capsys, options, says):
    assert main([str(recorded), *options]) == 2
    assert says in capsys.readouterr().err


def test_another_version_is_named_beside_a_difference(recorded, tmp_path, capsys):
    source = rewrite(recorded, tmp_path / "source", lambda message: message.data, leave_out=("config.yaml",))
    config = yaml.safe_load((source / "config.yaml").read_text())
    config["versions"]["numpy"] = "1.0"
    config["git_revision"] = "abc"
    del config["parameters"]["fusion"]["tie_rule"]
    (source / "config.yaml").write_text(yaml.safe_dump(config))
    code, found = verify(source, capsys)
    assert (code, found["identical"]) == (1, False), "the default is another tie rule"
    assert found["notes"][0] == "not in the recording, so their defaults are used: tie_rule"
    assert any(note.startswith("recorded with numpy 1.0, here is ") for note in found["notes"])
    assert any(note.startswith("recorded with revision abc, here is ") for note in found["notes"])


def test_durations_in_steps_of_an_older_recording_are_understood(tmp_path, capsys):
    run = record_match(tmp_path / "run", max_steps=60, controller="fbql", guided=0, episodes=2, fbql_hold_s=0.15)
    copy = rewrite(run, tmp_path / "older", lambda message: message.data, leave_out=("config.yaml",))
    config = yaml.safe_load((copy / "config.yaml").read_text())
    parameters = config["parameters"]["fusion"]
    assert round(parameters.pop("fbql_hold_s") * 60) == 9
    for changed, code in ((9, 0), (4, 1)):
        (copy / "config.yaml").write_text(
            yaml.safe_dump({**config, "parameters": {"fusion": {**parameters, "fbql_hold_steps": changed}}})
        )
        assert verify(copy, capsys)[0] == code


@pytest.mark.parametrize("files", [None, 5, True, "a.json", [1, 2, 3], [None], [[]], {"a": "b"}], ids=str)
@pytest.mark.parametrize("options", [["--verify"], ["--set", "weight_gain=0.05"]], ids=lambda words: words[0])
def test_tree_files_that_are_no_list_of_texts_are_one_line(recorded, tmp_path, capsys, options, files):
    source = rewrite(recorded, tmp_path / "source", lambda message: message.data, leave_out=("config.yaml",))
    config = yaml.safe_load((source / "config.yaml").read_text())
    config["parameters"]["fusion"]["tree_files"] = files
    (source / "config.yaml").write_text(yaml.safe_dump(config))
    assert main([str(source), *options]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert f"{source}: config.yaml: parameter 'tree_files' must be list[str], not " in line


# After a gap


@pytest.mark.parametrize(
    ("number", "controller"), [(n, c) for n in (0, 1, -1) for c in ("subsumption", "fbql_literal")]
)
def test_of_a_recovered_run_everything_that_can_be_compared_is(tmp_path, capsys, number, controller):
    """Fault 80."""
    run = record_match(tmp_path / "run", max_steps=20, controller=controller, guided=0, episodes=4)
    steps = sum(1 for _ in open_run(run).steps())
    begin, end = places_of(mcap_of(run), Opcode.CHUNK)[number]
    spoil(mcap_of(run), (begin + end) // 2)
    found = recover(run, None)
    code, verified = verify(found.path, capsys)
    assert (code, verified["identical"]) == (3, True)
    assert verified["steps"] + verified["answers_only"] == found.steps < steps
    if number == -1:
        assert (verified["answers_only"], verified["resumed"]) == (0, None)
    elif controller == "subsumption":
        assert (verified["answers_only"], verified["resumed"]) == (0, verified["gap"])
    else:
        assert verified["answers_only"] > 0
        assert verified["resumed"] is None


def without_chunk(run: Path, number: int) -> Path:
    """The run without one of its chunks, recovered."""
    begin, end = places_of(mcap_of(run), Opcode.CHUNK)[number]
    spoil(mcap_of(run), (begin + end) // 2)
    return recover(run, None).path


@pytest.fixture(scope="module")
def policies(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """A policy of each learner."""
    place = tmp_path_factory.mktemp("policies")
    names = ("fbql", "fbql_literal", "fbql_value")
    return {name: record_match(place / name, controller=name, guided=1, max_steps=40) / "policy.npz" for name in names}


@pytest.mark.parametrize(
    ("controller", "own"),
    [
        ("fbql", {}),
        ("fbql", {"fbql_play": "drawn"}),
        ("fbql", {"fbql_play": "blended", "fbql_patience": 0}),
        ("fbql_literal", {}),
        ("fbql_value", {"fbql_value_play": "drawn"}),
    ],
)
@pytest.mark.parametrize("number", [0, 1])
def test_a_frozen_policy_is_compared_again_from_the_next_episode_on(
    policies, tmp_path, capsys, number, controller, own
):
    """It learns nothing from what is lost; only how many random draws are lost is not known."""
    frozen = {"controller": controller, "learn": False, "policy": policies[controller], **own}
    path = without_chunk(record_match(tmp_path / "run", max_steps=30, episodes=4, **frozen), number)
    code, found = verify(path, capsys)
    assert (code, found["identical"], found["answers_only"]) == (3, True, 0)
    assert found["steps"] == sum(1 for _ in open_run(path).steps()) > 60
    assert found["resumed"] == found["gap"] is not None
    assert (found["draws_as_recorded"] > 0) == ("drawn" in own.values())
    main([str(path), "--verify"])
    assert ("taken as recorded:" in capsys.readouterr().out) == ("drawn" in own.values())


def test_after_a_gap_a_decision_of_another_policy_is_a_difference(policies, tmp_path):
    frozen = {"controller": "fbql", "learn": False, "policy": policies["fbql"], "fbql_play": "drawn"}
    run = open_run(without_chunk(record_match(tmp_path / "run", max_steps=30, episodes=4, **frozen), 0))
    parameters, _ = recorded_parameters(run)
    behaviors = RecordedBehaviors(run, recorded_trees(run), {})
    other = verify_steps(run, SoccerSession(parameters, None), behaviors, lambda _: None)
    assert other.difference is not None
    assert other.difference.episode == 1
    assert "learned_weights" in other.difference.what


def test_while_it_learns_no_decision_after_a_gap_is_compared(policies, tmp_path, capsys):
    learns = {"controller": "fbql_literal", "policy": policies["fbql_literal"], "guided": 0}
    path = without_chunk(record_match(tmp_path / "run", max_steps=30, episodes=3, **learns), 0)
    code, found = verify(path, capsys)
    assert (code, found["identical"], found["steps"], found["resumed"]) == (3, True, 0, None)
    assert found["answers_only"] == sum(1 for _ in open_run(path).steps()) > 0
    main([str(path), "--verify"])
    assert capsys.readouterr().out.startswith(
        "no step could be compared as a whole; the behaviors' answers are identical"
    )


def without_attachment(run: Path, name: str) -> Path:
    """The run's MCAP file alone, without an attachment, recovered."""
    data = mcap_of(run).read_bytes()
    (begin, end), *_ = [
        place for place in places_of(mcap_of(run), Opcode.ATTACHMENT) if name.encode() in data[slice(*place)][:100]
    ]
    alone = Path(shutil.copyfile(mcap_of(run), run.parent / "alone.mcap"))
    spoil(alone, (begin + end) // 2)
    found = recover(alone, None)
    assert found.attachments_lost == [name]
    return found.path


@pytest.mark.parametrize("name", ["config.yaml", "policy_before.npz"])
def test_without_its_parameters_or_policy_a_runs_answers_are_compared(policies, tmp_path, capsys, name):
    policy = policies["fbql"]
    path = without_attachment(record_match(tmp_path / "run", controller="fbql", learn=False, policy=policy), name)
    code, found = verify(path, capsys)
    assert (code, found["identical"], found["steps"], found["digest"]) == (3, True, 0, None)
    assert found["answers_only"] == sum(1 for _ in open_run(path).steps()) > 0
    assert name in found["decisions_not_recomputed"]
    assert main([str(path), "--verify"]) == 3
    assert (
        f"decisions and commands were not compared: the {'para' if name[0] == 'c' else 'poli'}"
        in capsys.readouterr().out
    )


def test_without_its_parameters_a_runs_answers_are_still_compared(recorded, tmp_path, capsys):
    def raise_leaf(message):
        if message.topic != "/behaviors/approaching":
            return message.data
        output = decode_output(message.data)
        return encode_output(output._replace(leaf_id=output.leaf_id + 1)) if output.step == 9 else message.data

    run = rewrite(recorded, tmp_path / "run", raise_leaf)
    path = without_attachment(run, "config.yaml")
    code, found = verify(path, capsys)
    assert (code, found["identical"]) == (1, False)
    assert found["first_difference"]["what"] == "leaf_id of the answer of approaching"
    assert found["first_difference"]["step"] == 9


def test_a_lost_start_of_the_file_is_made_up_for_by_what_is_beside_it(recorded, tmp_path, capsys):
    """Header, schemas, channels and attachments are zeros; the summary describes the topics."""
    run = Path(shutil.copytree(recorded, tmp_path / "run"))
    first = places_of(mcap_of(run), Opcode.CHUNK)[0][0]
    spoil(mcap_of(run), 8, bytes(first - 8))
    alone = Path(shutil.copyfile(mcap_of(run), tmp_path / "alone.mcap"))
    path = recover(run, None).path
    code, found = verify(path, capsys)
    assert (code in (0, 3), found["identical"], found["answers_only"]) == (True, True, 0)
    assert found["steps"] == sum(1 for _ in open_run(recorded).steps())
    assert found["digest"] == digest_of(recorded)
    path = recover(alone, None).path
    assert main([str(path), "--verify"]) == 2
    (line,) = [each for each in capsys.readouterr().err.splitlines() if "warning: " not in each]
    assert "the parameters of the run (config.yaml) are lost, and no answer can be recomputed either" in line
