"""`replay RUN --verify` of a mux that learned or played a policy: every decision is recomputed from its recorded snapshot.

A decision holds everything that it was based on: the observations, the sources' last commands, which of them could drive, the
reward. So the decisions alone are enough. The commands that went out are recorded for people.
"""

from __future__ import annotations

from collections.abc import Callable

from fbql_common.core.cdr import Malformed
from fbql_common.core.errors import BadInput
from fbql_common.core.mux_types import MuxDecision
from fbql_fusion.core.mux.learning import NODE, description_of, session_of
from fbql_fusion.core.mux.snapshot import snapshot_of
from fbql_fusion.core.tasks.twist.answers import SourceLeaves
from fbql_recording.core.decoding import MUX_DECISION, MessageCodec
from fbql_recording.mcap.reader import Corrupt
from fbql_recording.run import Run

from fbql.replay.differences import Difference, Verification, compared
from fbql.replay.recomputation import recorded_policy

_PROGRESS_STEPS = 4096


def verify_mux(run: Run, progress: Callable[[int], None]) -> Verification:
    """Recomputes a recording up to the first difference, or to where messages are lost.

    Args:
        progress: called now and then with the number of decisions done.

    Raises:
        BadInput: the recording is damaged, or can't be recomputed.
    """
    given = run.parameters.get(NODE)
    if not given:
        raise BadInput(f"{run.path}: it has no parameters of a mux; its decisions can't be recomputed")
    description = description_of(given, f"{run.path}: config.yaml")
    try:
        session, robot = session_of(description, recorded_policy(run, NODE)), description.robot
    except BadInput as error:
        raise BadInput(f"{run.path}: config.yaml: {error}") from None
    leaves = SourceLeaves(robot.space)
    sources = len(session.behaviors)
    lengths = [sources, sources, sources * len(robot.space.axes), sum(robot.lengths)]
    topics = [topic for topic in run.topics.values() if topic.type_name == MUX_DECISION]
    codec = MessageCodec[MuxDecision](MUX_DECISION, topics[0].schema)
    steps = 0
    due, was_degraded = (0, 0), False
    difference: Difference | None = None
    gap: str | None = None
    for message in run.messages([topics[0].name]):
        try:
            recorded = codec.decode(message.data)
        except Malformed as error:
            raise Corrupt(f"{run.path}: decision {steps} (at {message.log_time_ns / 1e9:.3f} s): {error}") from None
        at = recorded.stamp_ns
        if recorded.degraded and not was_degraded and recorded.step > 1 and recorded.step == due[1] + 1:
            due = (due[0], recorded.step)  # the mux left out a step, because nobody told what happened
        was_degraded = recorded.degraded and not (recorded.terminated or recorded.truncated)
        if (recorded.episode, recorded.step) != due:
            came = f"episode {recorded.episode}, step {recorded.step}"
            if not run.is_complete:
                gap = f"{came} (at {at / 1e9:.3f} s)"
                break
            expected = f"episode {due[0]}, step {due[1]}"
            difference = Difference(steps, *due, at, "the schedule", came, expected)
            break
        snapshot = snapshot_of(recorded)
        if snapshot.step == 0 and session.next_episode() is None:
            difference = Difference(steps, *due, at, "the schedule", f"episode {due[0]}", "the run had ended before it")
            break
        if [len(part) for part in (recorded.active, recorded.ages_s, recorded.commands, recorded.observed)] != lengths:
            raise BadInput(f"{run.path}: its decisions do not match the sources and observations in its config.yaml")
        command, decision = session.decide(snapshot.moment(robot.lengths), snapshot.answers(leaves))
        differs = compared(codec, snapshot.decided(decision, command), message.data)
        if differs is not None:
            what = f"{differs.field} of the decision"
            difference = Difference(steps, *due, at, what, differs.recorded, differs.recomputed)
            break
        steps += 1
        due = (due[0] + 1, 0) if snapshot.terminated or snapshot.truncated else (due[0], due[1] + 1)
        if steps % _PROGRESS_STEPS == 0:
            progress(steps)
    return Verification(steps, difference, session.digest, {}, 0, gap, answers=steps)
