"""The assembly of a step: nothing is decided twice, too early, out of order, or with what does not belong to it."""

from fbql_common.core.types import BehaviorOutput, World
from fbql_fusion.core.assembly import MAX_GAP_S, Arrival, StepAssembly
from hypothesis import given
from hypothesis import strategies as st

NAMES = ("a", "b", "c")
DT_NS = 20_000_000
MAX_GAP_STEPS = round(MAX_GAP_S * 1e9) // DT_NS


def world_of(step, episode=0, stamp_ns=None, **fields):
    stamp_ns = DT_NS * (step + 1) if stamp_ns is None else stamp_ns
    return World(stamp_ns, episode, step, *[0.0] * 12, *[False] * 6)._replace(**fields)


def answer(world, index, **fields):
    return BehaviorOutput(*world[:3], NAMES[index], 1.0, 2.0, index, 3, "hash", False, ())._replace(**fields)


def assembly_at(step=-1, episode=0):
    """An assembly whose step `step` was decided with everybody."""
    assembly = StepAssembly(NAMES)
    assembly.begin(episode)
    for past in range(step + 1):
        world = world_of(past, episode)
        assembly.add_world(world, b"world")
        answer_all(assembly, world)
        assembly.decided(assembly.complete())
    return assembly


def answer_all(assembly, world, indices=(0, 1, 2)):
    for index in indices:
        assembly.add_output(index, answer(world, index), f"answer {index}".encode())


def test_step_is_complete_with_its_world_and_every_answer():
    assembly, world = assembly_at(), world_of(0)
    assert assembly.add_world(world, b"world") is Arrival.NEW
    for index in range(3):
        assert assembly.complete() is None
        answer_all(assembly, world, [index])
    step = assembly.complete()
    assert (step.world, step.world_data) == (world, b"world")
    assert step.outputs == [answer(world, index) for index in range(3)]
    assert step.data == [b"answer 0", b"answer 1", b"answer 2"]


def test_every_behavior_is_waited_for_before_it_has_ever_answered():
    assembly, world = assembly_at(), world_of(0)
    assembly.add_world(world, b"")
    answer_all(assembly, world, [0, 2])
    assert assembly.complete() is None
    assert assembly.missing() == ["b"]


def test_answers_may_come_before_their_world():
    assembly, world = assembly_at(4), world_of(5)
    answer_all(assembly, world)
    assert assembly.complete() is None
    assembly.add_world(world, b"")
    assert assembly.complete().outputs == [answer(world, index) for index in range(3)]


def test_decided_step_is_not_complete_again():
    assembly, world = assembly_at(4), world_of(4)
    assert assembly.add_world(world, b"") is Arrival.DECIDED
    answer_all(assembly, world)
    assert assembly.complete() is None and assembly.oldest() is None


def test_world_that_is_waiting_for_answers_is_not_new_again():
    assembly = assembly_at(4)
    assert assembly.add_world(world_of(5), b"first") is Arrival.NEW
    assert assembly.add_world(world_of(5), b"again") is Arrival.WAITING
    assert assembly.oldest().world_data == b"first"


def test_worlds_of_other_steps_and_episodes_are_foreign():
    assembly = assembly_at(4)
    foreign = [
        world_of(3),
        world_of(5, episode=1),
        world_of(0, episode=-1, stamp_ns=10**9),
        world_of(4, stamp_ns=10**9),
        world_of(2, stamp_ns=10**9),
        world_of(4, ball_x_m=0.5),
    ]
    assert [assembly.add_world(world, b"") for world in foreign] == [Arrival.FOREIGN] * len(foreign)
    assert assembly.oldest() is None


def test_world_far_ahead_of_the_episode_is_foreign():
    assembly = assembly_at(3)
    assert assembly.add_world(world_of(3 + MAX_GAP_STEPS + 1), b"") is Arrival.FOREIGN
    assert assembly.add_world(world_of(10**6), b"") is Arrival.FOREIGN
    assert assembly.add_world(world_of(3 + MAX_GAP_STEPS), b"") is Arrival.NEW


def test_a_step_far_ahead_at_a_time_that_is_not_is_foreign():
    assembly = assembly_at(3)
    assert assembly.add_world(world_of(10**6, stamp_ns=world_of(4).stamp_ns), b"") is Arrival.FOREIGN
    assert assembly.add_world(world_of(4), b"") is Arrival.NEW


def test_world_states_that_come_one_by_one_never_get_too_far_ahead_of_a_step_that_waits():
    assembly = assembly_at(3)
    for step in range(4, 3 + 3 * MAX_GAP_STEPS):
        assert assembly.add_world(world_of(step), b"") is Arrival.NEW
    assert assembly.oldest() is not None


def test_episode_counts_from_its_first_step_on():
    assembly = assembly_at(4)
    assembly.begin(1)
    assert assembly.add_world(world_of(7, episode=1, stamp_ns=100), b"") is Arrival.FOREIGN
    assert assembly.add_world(world_of(0, episode=1, stamp_ns=1), b"") is Arrival.NEW, "time may begin anew"
    assert assembly.add_world(world_of(1, episode=1, stamp_ns=2), b"") is Arrival.NEW


def test_episode_that_was_lost_counts_from_wherever_it_is_found():
    assembly = assembly_at(4)
    assembly.begin(0, anywhere=True)
    assert assembly.add_world(world_of(7, stamp_ns=1), b"") is Arrival.NEW
    assembly.begin(1)
    assert assembly.add_world(world_of(7, episode=1), b"") is Arrival.FOREIGN


def test_answers_of_the_episode_before_are_forgotten():
    assembly, world = assembly_at(4), world_of(5)
    answer_all(assembly, world)
    assembly.begin(1)
    assembly.add_world(world_of(0, episode=1, stamp_ns=world.stamp_ns), b"")
    assert assembly.missing() == list(NAMES)


def test_answers_to_an_earlier_play_of_the_episode_are_forgotten():
    assembly, world = assembly_at(), world_of(0)
    answer_all(assembly, world)
    assembly.begin(0)
    assembly.add_world(world, b"")
    assert assembly.missing() == list(NAMES)


def test_answer_with_the_stamp_of_a_step_but_another_number_is_none():
    for world_first in (True, False):
        assembly, world = assembly_at(4), world_of(5)
        if world_first:
            assembly.add_world(world, b"")
        assembly.add_output(0, answer(world, 0, step=6), b"")
        assembly.add_output(1, answer(world, 1, episode=2), b"")
        assembly.add_output(2, answer(world, 2), b"")
        assembly.add_world(world, b"")
        assert assembly.missing() == ["a", "b"]


def test_dropped_behavior_is_waited_for_again_once_it_answers_in_time():
    assembly = assembly_at(4)
    late, world = world_of(5), world_of(6)
    assembly.add_world(late, b"")
    answer_all(assembly, late, [0, 2])
    assert assembly.drop_missing() == ["b"]
    assert assembly.drop_missing() == [], "it was dropped already"
    step = assembly.complete()
    assert step.outputs[1] is None and step.data[1] == b""
    assembly.decided(step)

    assembly.add_output(1, answer(world_of(3), 1), b"")
    assembly.add_world(world, b"")
    answer_all(assembly, world, [0, 2])
    assert assembly.complete() is not None, "an answer that is far too late counts for nothing"
    answer_all(assembly, late, [1])
    assert assembly.complete() is None, "one to the last decided step says that it is back"
    answer_all(assembly, world, [1])
    assert None not in assembly.complete().outputs


def test_step_without_any_answer_is_never_complete():
    assembly = assembly_at(4)
    assembly.add_world(world_of(5), b"")
    assert assembly.drop_missing() == list(NAMES)
    assert assembly.complete() is None
    assert assembly.newest().world == world_of(5)


def test_steps_may_overlap_and_the_newest_complete_one_ends_those_before():
    assembly = assembly_at(4)
    worlds = [world_of(step) for step in (5, 6, 7)]
    for world in worlds:
        assembly.add_world(world, b"")
    assert assembly.oldest().world == worlds[0] and assembly.newest().world == worlds[2]
    answer_all(assembly, worlds[0], [0])
    answer_all(assembly, worlds[1])
    step = assembly.complete()
    assert step.world == worlds[1]
    assembly.decided(step)
    answer_all(assembly, worlds[0])
    assert assembly.complete() is None
    answer_all(assembly, worlds[2])
    assert assembly.complete().world == worlds[2]


def test_a_later_world_with_a_lower_number_is_not_decided_after_the_higher_one():
    """A world state that is wrong but valid may come between: its step would be out of order."""
    assembly = assembly_at(step=0)
    higher, lower = world_of(20, stamp_ns=10**9), world_of(10, stamp_ns=2 * 10**9)
    assembly.add_world(higher, b"")
    assembly.add_world(lower, b"")
    answer_all(assembly, higher)
    assembly.decided(assembly.complete())
    answer_all(assembly, lower)
    assert assembly.complete() is None


def test_newest_step_is_decided_when_several_are_complete_without_the_dropped():
    assembly = assembly_at(4)
    worlds = [world_of(step) for step in (5, 6)]
    for world in worlds:
        assembly.add_world(world, b"")
        answer_all(assembly, world, [0, 2])
    assembly.drop_missing()
    assert assembly.complete().world == worlds[1]


def test_memory_does_not_grow_with_stray_messages():
    assembly = assembly_at(4)
    for step in range(10, 10_000):
        assembly.add_output(0, answer(world_of(step), 0), b"")
    assert len(assembly._steps) < 100
    world = world_of(5)
    assembly.add_world(world, b"")
    answer_all(assembly, world)
    assert assembly.complete().world == world


def test_answers_with_stamps_of_the_future_do_not_push_out_the_step_that_is_played():
    assembly, world = assembly_at(4), world_of(5)
    assembly.add_world(world, b"")
    answer_all(assembly, world, [0, 1])
    for step in range(100, 200):
        assembly.add_output(2, answer(world_of(step), 2), b"")
    assert assembly.missing() == ["c"]
    answer_all(assembly, world, [2])
    assert assembly.complete().outputs == [answer(world, index) for index in range(3)]


EVENTS = st.lists(
    st.one_of(
        st.tuples(st.just("world"), st.integers(0, 6), st.integers(0, 1)),
        st.tuples(st.just("answer"), st.integers(0, 6), st.integers(0, 1), st.integers(0, 2)),
        st.tuples(st.just("late")),
    ),
    max_size=60,
)


@given(EVENTS)
def test_whatever_comes_steps_are_decided_once_in_order_and_with_their_own_answers(events):
    assembly = StepAssembly(NAMES)
    assembly.begin(0)
    came, decided = set(), []
    for kind, *what in events:
        if kind == "world":
            assembly.add_world(world_of(*what), b"")
            came.add(("world", *what))
        elif kind == "answer":
            step, episode, index = what
            assembly.add_output(index, answer(world_of(step, episode), index), b"")
            came.add(("answer", *what))
        elif assembly.oldest() is not None:
            assembly.drop_missing()
        complete = assembly.complete()
        if complete is None:
            continue
        world = complete.world
        assert world.episode == 0
        assert ("world", world.step, 0) in came
        for index, output in enumerate(complete.outputs):
            assert output is None or output == answer(world, index)
            assert output is None or ("answer", world.step, 0, index) in came
        assert any(complete.outputs), "decided with nobody"
        decided.append(world.step)
        assembly.decided(complete)
    assert decided == sorted(set(decided))


@given(st.permutations([(step, what) for step in range(3) for what in ("world", 0, 1, 2)]))
def test_in_lockstep_every_order_of_arrival_decides_every_step_with_all(order):
    assembly = StepAssembly(NAMES)
    assembly.begin(0)
    decided = []
    for step in range(3):
        world = world_of(step)
        for _, what in [item for item in order if item[0] == step]:
            if what == "world":
                assembly.add_world(world, b"")
            else:
                answer_all(assembly, world, [what])
        complete = assembly.complete()
        decided.append(complete.world.step)
        assert None not in complete.outputs
        assembly.decided(complete)
    assert decided == [0, 1, 2]
