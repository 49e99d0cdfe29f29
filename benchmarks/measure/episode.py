"""Steps per second of a match in one process, with learning, against the bare physics step, interleaved in one run.

A controller that learns is first trained (`--warm-up`), so that a trained learner is measured. Then some episodes are played
once and recorded, and every round measures the cost of the same episodes, from the same state of the learner:

whole     the match as train.py plays it: session, world loop, behaviors
bare      only the Chipmunk calls of its physics: velocities set, physics steps, state read
physics   Physics.step with the same wheel velocities
loop      WorldLoop.step with the same commands
resets    WorldLoop.reset with the same seeds
sensing   Behavior.answer of every behavior to the same worlds
decide    Session.decide on the same worlds and answers, learning included

`steps_per_s` is of the whole, `physics_steps_per_s` of bare, `ratio` is the median over rounds of whole / bare. `step_us`
breaks down the time of a step: each part excludes the part that it contains. While a decision is held, the whole asks only the
behavior that drives; sensing and decide ask all of them, so that `between` may be below 0. The clock is the processor time of this
process, so that other programs on the machine hardly matter.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Callable, Sequence
from statistics import median
from time import process_time
from typing import Any, NamedTuple
from unittest.mock import patch

from fbql.cli.parser import Parser
from fbql.match.in_process import play
from fbql.match.trees import playing_trees
from fbql_behaviors.core.behavior import Behavior
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import load_tree
from fbql_common.core.types import BehaviorOutput, Decision, WheelCommand, World
from fbql_fusion.core.controllers.parameters import CONTROLLERS
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.session import episode_seed
from fbql_fusion.core.soccer_session import SoccerSession
from fbql_sim.core import physics as chipmunk
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.physics import Physics
from fbql_sim.core.task import Task
from fbql_sim.core.world_loop import WorldLoop

PROGRAM = "episode.py"
WARM_UP_SEED, SEED = 1, 2
MICROSECONDS = 1e6
Velocities = tuple[Any, ...]
"""The velocities that the physics sets before a step: the arguments of its calls, in order."""


class PlayedEpisode(NamedTuple):
    """An episode as it was played."""

    seed: int
    worlds: list[World]
    outputs: list[Sequence[BehaviorOutput]]
    commands: list[tuple[float, float]]
    """One fewer than worlds: the last world gets no command."""


def main(argv: Sequence[str]) -> int:
    """Runs the benchmark. Returns the exit code."""
    parser = Parser(prog=PROGRAM, description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--controller", choices=CONTROLLERS, default="fbql_literal", help="who fuses (fbql_literal)")
    parser.add_argument("--steps", type=int, default=20_000, metavar="N", help="steps of a round, at least (20000)")
    parser.add_argument(
        "--warm-up", type=int, default=200, metavar="N", help="episodes of learning before it is measured (200)"
    )
    parser.add_argument("--rounds", type=int, default=9, metavar="N", help="rounds to take medians over (9)")
    parser.add_argument("--json", action="store_true", help="print one JSON object, and nothing else, on stdout")
    arguments = parser.parse_args(list(argv))
    for name, least in (("rounds", 1), ("steps", 1), ("warm_up", 0)):
        if getattr(arguments, name) < least:
            option = name.replace("_", "-")
            parser.error(f"--{option} is {getattr(arguments, name)}; it must be {least} or more")
    result = measure(arguments.controller, arguments.steps, arguments.rounds, arguments.warm_up)
    print(json.dumps(result) if arguments.json else as_text(result))
    return 0


def measure(controller: str, steps: int, rounds: int, warm_up: int = 0) -> dict[str, Any]:
    """The results for a controller."""
    fusion = FusionParameters(controller=controller, seed=SEED, guided=0)
    behaviors = [Behavior(name, load_tree(shipped_trees() / f"{name}.json")) for name in fusion.behaviors]
    policy = train(controller, behaviors, warm_up)
    episodes, digest = play_once(fusion, policy, behaviors, steps)
    count = sum(len(episode.commands) for episode in episodes)
    velocities = [velocities_of(episode) for episode in episodes]
    parts: dict[str, Callable[[], float]] = {
        "whole": lambda: whole(fusion, policy, behaviors, len(episodes), digest),
        "bare": lambda: sum(bare(*each) for each in zip(episodes, velocities, strict=True)),
        "physics": lambda: sum(map(physics, episodes)),
        "loop": lambda: sum(map(loop, episodes)),
        "resets": lambda: resets(episodes),
        "sensing": lambda: sensing(behaviors, episodes),
        "decide": lambda: decide(fusion, policy, behaviors, episodes, digest),
    }
    found: dict[str, list[float]] = {name: [] for name in parts}
    for number in range(rounds):
        for name, part in parts.items():
            found[name].append(part() / count * MICROSECONDS)
        words = ", ".join(f"{name} {values[-1]:.2f}" for name, values in found.items())
        print(f"round {number + 1}/{rounds}: {words} us a step", file=sys.stderr, flush=True)

    def of(value: Callable[[dict[str, float]], float]) -> float:
        return median(value({name: values[i] for name, values in found.items()}) for i in range(rounds))

    return {
        "steps_per_s": of(lambda us: MICROSECONDS / us["whole"]),
        "physics_steps_per_s": of(lambda us: MICROSECONDS / us["bare"]),
        "ratio": of(lambda us: us["bare"] / us["whole"]),
        "step_us": {
            "whole": of(lambda us: us["whole"]),
            "bare_physics": of(lambda us: us["bare"]),
            "physics": of(lambda us: us["physics"] - us["bare"]),
            "task_and_loop": of(lambda us: us["loop"] - us["physics"]),
            "resets": of(lambda us: us["resets"]),
            "sensing_and_trees": of(lambda us: us["sensing"]),
            "decide_and_learn": of(lambda us: us["decide"]),
            "between": of(lambda us: us["whole"] - us["loop"] - us["resets"] - us["sensing"] - us["decide"]),
        },
        "controller": controller,
        "warm_up": warm_up if policy is not None else 0,
        "steps": count,
        "episodes": len(episodes),
        "rounds": rounds,
        "digest": digest,
        "clock": "processor time",
    }


def session_of(fusion: FusionParameters, policy: Policy | None, behaviors: Sequence[Behavior]) -> SoccerSession:
    """A session that knows the behaviors' trees."""
    return SoccerSession(fusion, policy, playing_trees(behavior.tree for behavior in behaviors))


def train(controller: str, behaviors: Sequence[Behavior], episodes: int) -> Policy | None:
    """A controller's policy after its guided episodes and `episodes` more; None for one that does not learn."""
    fusion = FusionParameters(controller=controller, seed=WARM_UP_SEED, episodes=episodes)
    session = session_of(fusion, None, behaviors)
    if episodes == 0 or session.guided == 0:
        return None
    play(session, WorldLoop(), behaviors, lambda: True)
    return session.policy()


def play_once(
    fusion: FusionParameters, policy: Policy | None, behaviors: Sequence[Behavior], steps: int
) -> tuple[list[PlayedEpisode], str]:
    """Whole episodes of at least `steps` steps in all, and their digest."""
    session, episodes = session_of(fusion, policy, behaviors), list[PlayedEpisode]()

    def step_decided(
        world: World, outputs: Sequence[BehaviorOutput], command: WheelCommand, _decision: Decision
    ) -> None:
        if world.step == 0:
            episodes.append(PlayedEpisode(episode_seed(fusion.seed, world.episode), [], [], []))
        episodes[-1].worlds.append(world)
        episodes[-1].outputs.append(outputs)
        if not world.ended:
            episodes[-1].commands.append((command.left_rad_s, command.right_rad_s))

    play(session, WorldLoop(), behaviors, lambda: session.steps < steps, step_decided)
    return episodes, session.digest


def whole(
    fusion: FusionParameters, policy: Policy | None, behaviors: Sequence[Behavior], episodes: int, digest: str
) -> float:
    """Seconds of the match."""
    session, world_loop = session_of(fusion, policy, behaviors), WorldLoop()
    begun_s = process_time()
    play(session, world_loop, behaviors, lambda: len(session.records) < episodes)
    seconds = process_time() - begun_s
    assert session.digest == digest
    return seconds


def velocities_of(episode: PlayedEpisode) -> list[Velocities]:
    """What the physics sets before each step: velocity and spin of the robot and, while it rolls, of the ball."""
    velocities: list[Velocities] = []
    values: list[Any] = []

    def recording(function: Callable[[Any, Any], None]) -> Callable[[Any, Any], None]:
        def record(body: Any, value: Any) -> None:
            values.append(value)
            function(body, value)

        return record

    functions = {name: recording(getattr(chipmunk, name)) for name in ("set_velocity", "set_spin")}
    with patch.multiple(chipmunk, **functions):
        world_loop = WorldLoop()
        world_loop.reset(0, episode.seed)
        for command in episode.commands:
            values.clear()
            world_loop.step(*command)
            velocities.append(tuple(values))
    return velocities


def bare(episode: PlayedEpisode, velocities: Sequence[Velocities]) -> float:
    """Seconds of the Chipmunk calls."""
    parameters = SimulationParameters()
    of = Physics(parameters)
    of.reset(Task(parameters).begin(episode.seed))
    space, robot, ball = of._c_space, of._c_robot, of._c_ball
    substeps, substep_s = of._substeps, of._substep_s
    set_velocity, set_spin, advance = chipmunk.set_velocity, chipmunk.set_spin, chipmunk.advance
    position, velocity = chipmunk.get_position, chipmunk.get_velocity
    angle, spin = chipmunk.get_angle, chipmunk.get_spin
    begun_s = process_time()
    for each in velocities:
        set_velocity(robot, each[0])
        set_spin(robot, each[1])
        if len(each) > 2:
            set_velocity(ball, each[2])
            set_spin(ball, each[3])
        for _ in substeps:
            advance(space, substep_s)
        position(robot), velocity(robot), angle(robot), spin(robot), position(ball), velocity(ball)
    seconds = process_time() - begun_s
    at = position(ball)
    assert (at.x, at.y) == (episode.worlds[-1].ball_x_m, episode.worlds[-1].ball_y_m)
    return seconds


def physics(episode: PlayedEpisode) -> float:
    """Seconds of Physics.step."""
    parameters = SimulationParameters()
    task, of = Task(parameters), Physics(parameters)
    of.reset(task.begin(episode.seed))
    driven = [task.disturb(*command) for command in episode.commands]
    step = of.step
    begun_s = process_time()
    for left, right in driven:
        step(left, right)
    seconds = process_time() - begun_s
    assert of.ball_x_m == episode.worlds[-1].ball_x_m
    return seconds


def loop(episode: PlayedEpisode) -> float:
    """Seconds of WorldLoop.step."""
    world_loop = WorldLoop()
    world_loop.reset(0, episode.seed)
    step = world_loop.step
    begun_s = process_time()
    for left, right in episode.commands:
        step(left, right)
    return process_time() - begun_s


def resets(episodes: Sequence[PlayedEpisode]) -> float:
    """Seconds of WorldLoop.reset."""
    world_loop = WorldLoop()
    begun_s = process_time()
    for index, episode in enumerate(episodes):
        world_loop.reset(index, episode.seed)
    return process_time() - begun_s


def sensing(behaviors: Sequence[Behavior], episodes: Sequence[PlayedEpisode]) -> float:
    """Seconds of Behavior.answer."""
    answers = [behavior.answer for behavior in behaviors]
    begun_s = process_time()
    for episode in episodes:
        for world in episode.worlds:
            for answer in answers:
                answer(world)
    return process_time() - begun_s


def decide(
    fusion: FusionParameters,
    policy: Policy | None,
    behaviors: Sequence[Behavior],
    episodes: Sequence[PlayedEpisode],
    digest: str,
) -> float:
    """Seconds of Session.decide, and of a learner's work between episodes."""
    session = session_of(fusion, policy, behaviors)
    begun_s = process_time()
    for episode in episodes:
        session.next_episode()
        for world, outputs in zip(episode.worlds, episode.outputs, strict=True):
            session.decide(world, outputs)
    seconds = process_time() - begun_s
    assert session.digest == digest
    return seconds


def as_text(result: dict[str, Any]) -> str:
    """The results as text."""
    lines = [
        f"{result['controller']}: {result['steps_per_s']:.0f} steps/s, bare physics "
        f"{result['physics_steps_per_s']:.0f} steps/s, ratio {result['ratio']:.3f}",
        "where a step goes [us]:",
    ]
    return "\n".join([*lines, *(f"  {name:18} {us:6.2f}" for name, us in result["step_us"].items())])
