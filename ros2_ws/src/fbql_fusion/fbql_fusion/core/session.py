"""The session: one run from its first episode to its last, decision by decision.

It owns the schedule, the episodes' seeds, the transitions and the records. It does not own the task, the behaviors, the
clock or any file, and does not know what is played: see `core.tasks.interface`. The same object serves a node and a run in one
process.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import isfinite
from sys import maxsize

import numpy as np
from fbql_common.core.command_space import Command
from fbql_common.core.errors import BadInput
from fbql_common.core.types import DRIVER_BLEND, NO_LEAF, Decision, Phase, made_of
from fbql_recording.core.metrics import Digest

from fbql_fusion.core.blending import blend
from fbql_fusion.core.controllers.guided import Guided
from fbql_fusion.core.controllers.interface import (
    Controller,
    Drawing,
    Holding,
    JointState,
    Learner,
    Reflecting,
    Transition,
)
from fbql_fusion.core.controllers.parameters import SessionParameters, guided_episodes
from fbql_fusion.core.policy import Policy
from fbql_fusion.core.tasks.interface import Answer, Answers, Episode, Guide, Moment, Task


@dataclass
class Rejections:
    """Counts of rejected inputs, by reason."""

    leaf_ids: int = 0
    """Answers with a leaf_id outside of 0 .. leaf_count - 1."""
    references: int = 0
    """Answers with a reference that is not finite."""
    trees: int = 0
    """Answers from another tree than the behavior's first."""
    weights: int = 0
    """Weights of the wrong number, or not finite, which were replaced by uniform ones."""

    @property
    def total(self) -> int:
        """The sum of all counts."""
        return self.leaf_ids + self.references + self.trees + self.weights

    def __str__(self) -> str:
        """The counts above 0, in words."""
        words = {
            "answers with a leaf that the tree does not have": self.leaf_ids,
            "answers with a reference that is not finite": self.references,
            "answers from another tree than the behavior's first": self.trees,
            "sets of weights that can't be used": self.weights,
        }
        return ", ".join(f"{count} {what}" for what, count in words.items() if count)


def episode_seed(run_seed: int, episode: int) -> int:
    """The seed of an episode, 0 .. 2^63 - 1: independent of the episodes before."""
    return int(np.random.SeedSequence([run_seed, episode]).generate_state(1, np.uint64)[0] >> np.uint64(1))


class Session[M: Moment, C, R]:
    """One run.

    Args:
        parameters: what is played.
        task: the task that is played.
        guide: drives the guided episodes.
        controller: decides in all others.
        policy: what an earlier run learned, to continue from.

    Raises:
        BadInput: a policy that does not belong to the controller and the behaviors.
    """

    def __init__(
        self,
        parameters: SessionParameters,
        task: Task[M, C, R],
        guide: Guide,
        controller: Controller,
        policy: Policy | None = None,
    ) -> None:
        self.parameters = parameters
        self.behaviors = tuple(parameters.behaviors)
        self.records: list[R] = []
        self.rejections = Rejections()
        self.unseen = 0
        """Steps of the episodes so far whose moments never came: others played them."""
        self._task = task
        self._space = task.space
        self._standstill = task.space.standstill
        self._controller = controller
        self._learner = self._controller if isinstance(self._controller, Learner) else None
        self._holding = controller if isinstance(controller, Holding) else None
        self._guided = Guided(guide, len(self.behaviors))
        self._given = policy
        if policy is not None:
            self._load(policy)
        self.is_learning = self._learner is not None and parameters.learn
        self._reflecting = controller if self.is_learning and isinstance(controller, Reflecting) else None
        self._before_reflection: Policy | None = None
        """The policy to return while the controller reflects: a continued run then reflects on the same."""
        self._free_phase = Phase.LEARNING if self.is_learning else Phase.EVALUATION
        self.guided = guided_episodes(parameters, self.is_learning, policy is not None)
        """Number of guided episodes, which come first."""
        self._trees: list[tuple[int, str] | None] = [None] * len(self.behaviors)
        self._digest = Digest()
        self._steps: int = 0
        self._counted = 0
        self._successes = 0

        # The episode being played. No moment belongs to none: see _close.
        self.phase = Phase.GUIDED if self.guided else self._free_phase
        self._index = -1
        self._seed = 0
        self._episode = -1
        self._step: int = maxsize
        self._driver = DRIVER_BLEND

    @property
    def digest(self) -> str:
        """SHA-256 over every decision so far, 64 hexadecimal digits."""
        return self._digest.hex

    @property
    def steps(self) -> int:
        """Steps driven so far, in every phase."""
        return self._steps

    @property
    def drawing(self) -> Drawing | None:
        """The controller, if its draws can be given to it."""
        return self._controller if isinstance(self._controller, Drawing) else None

    def policy(self) -> Policy | None:
        """What has been learned so far; None if the controller can't learn, or no answer has arrived yet."""
        if self._learner is None:
            return None
        if self._before_reflection is not None:
            return self._before_reflection
        if self._given is not None:
            hashes, counts = self._given.tree_hashes, self._given.leaf_counts
        else:
            heard = [tree for tree in self._trees if tree is not None]
            if len(heard) < len(self._trees):
                return None
            hashes, counts = tuple(tree[1] for tree in heard), tuple(tree[0] for tree in heard)
        return Policy(self._learner.kind, self.behaviors, hashes, counts, self._learner.to_arrays())

    def next_episode(self) -> tuple[int, int] | None:
        """Begins the next episode: its number and its seed, or None when the run is done.

        Raises:
            ValueError: the episode before has not ended.
        """
        if self._episode >= 0:
            raise ValueError(f"episode {self._episode} has not ended")
        if self.reflects_next:
            self._reflect()
        if self._is_over:
            return None
        self._index += 1
        self._seed = episode_seed(self.parameters.seed, self._index)
        self.phase = self._phase_of(self._index)
        return self._begin(degraded=False)

    @property
    def _is_over(self) -> bool:
        episodes, successes = self.parameters.episodes, self.parameters.success_limit
        return bool((episodes and self._counted >= episodes) or (successes and self._successes >= successes))

    def _phase_of(self, episode: int) -> Phase:
        return Phase.GUIDED if episode < self.guided else self._free_phase

    @property
    def reflects_next(self) -> bool:
        """Whether `next_episode` is going to take long, because the controller learns before the episode begins."""
        reflecting = self._reflecting
        return reflecting is not None and reflecting.is_due(self._phase_of(self._index + 1))

    def _reflect(self) -> None:
        """Lets the controller learn. Until that is done, the policy is what it was before."""
        assert self._reflecting is not None
        self._before_reflection = self.policy()
        self._reflecting.reflect()
        self._before_reflection = None

    def skip_to_episode(self, episode: int) -> None:
        """Makes an episode the next to begin, whatever is played now: those before it are not known here."""
        self._index = episode - 1
        self._episode = -1
        self._step = maxsize

    def restart_episode(self) -> tuple[int, int]:
        """Restarts the current episode because its moments were lost; returns its number and its seed.

        It is degraded if it had begun. Its record counts from the new start; `steps` and `digest` cover everything.

        Raises:
            ValueError: no episode is under way.
        """
        if self._episode < 0:
            raise ValueError("no episode is under way")
        return self._begin(degraded=self._degraded or self._step >= 0)

    def _begin(self, degraded: bool) -> tuple[int, int]:
        self._episode = self._index
        self._step = -1
        self._degraded = degraded
        self._return = 0.0
        self._task.begin_episode()
        self._controller.begin_episode(self.phase)
        return self._index, self._seed

    def decide(self, moment: M, answers: Answers) -> tuple[C, Decision]:
        """Answers a moment; learns from the transition that ended in it.

        A moment that ended the episode closes it: its command is 0 on every axis, and its weights are those that would
        have been used. A missing step or answer makes the rest of the episode degraded: it is played, but nothing is
        learned.

        Args:
            moment: the next one of the episode that `next_episode` began.
            answers: the behaviors' answers to it, in order; None where one did not answer.

        Raises:
            ValueError: a moment of another episode, or not later than the last one; a wrong number of answers.
            BadInput: the behaviors' trees are not those that the policy was learned with.
        """
        episode, step = moment.episode, moment.step
        if episode != self._episode or step <= self._step:
            raise ValueError(self._why_out_of_order(episode, step))
        if len(answers) != len(self._trees):
            raise ValueError(f"{len(answers)} answers of {len(self._trees)} behaviors")
        joint_state, heard, complete = self._hear(answers)
        task = self._task
        reward = task.reward(moment)
        self._return += reward

        if step != self._step + 1:
            self.unseen += step - self._step - 1
            self._degraded = True
        elif not complete:
            self._degraded = True
        phase = self.phase
        terminated, truncated = moment.terminated, moment.truncated
        if step > 0 and self._learner is not None and self.parameters.learn and not self._degraded:
            succeeded = terminated and task.outcome(moment).success
            values = (
                self._joint_state,
                self._weights,
                self._driver,
                reward,
                joint_state,
                terminated,
                truncated,
                succeeded,
                self._command,
            )
            self._learner.learn(made_of(Transition, values))

        weights, driver, q, learned_weights = self._controller.select(moment, joint_state, heard)
        if phase is Phase.GUIDED:
            weights, driver, _, _ = self._guided.select(moment, joint_state, heard)
        alone = heard[driver] if driver >= 0 else None
        if alone is not None and alone.active:
            command = alone.command
        else:
            command, weights, rejected = blend(weights, heard, self._space)
            driver = DRIVER_BLEND
            if rejected:
                self.rejections.weights += 1
        if terminated or truncated:
            command = self._standstill

        self._steps += step - max(self._step, 0)
        self._step = step
        self._joint_state = joint_state
        self._weights = weights
        self._driver = driver
        self._command = command
        self._digest.add(task.digest_bytes(moment, command))
        decided = (
            moment.stamp_ns,
            episode,
            step,
            self.parameters.controller,
            int(phase),
            self.behaviors,
            joint_state,
            q,
            weights,
            driver,
            reward,
            self._degraded,
            learned_weights,
        )
        if terminated or truncated:
            self._close(moment)
        return task.command(moment, command), made_of(Decision, decided)

    @property
    def held_driver(self) -> int:
        """The behavior whose answer to the next moment `hold` needs; DRIVER_BLEND where `decide` is needed."""
        if self._holding is None or self.phase is Phase.GUIDED or self._episode < 0:
            return DRIVER_BLEND
        driver = self._holding.held_driver
        return driver if driver == self._driver else DRIVER_BLEND

    def hold(self, moment: M, answer: Answer) -> Command | None:
        """What `decide` would command, for those who want neither the decision nor the other behaviors' answers, which it
        would not use.

        Args:
            moment: the next one of the episode.
            answer: that of `held_driver` to it.

        Returns:
            None where `decide` is needed after all; nothing has happened then.
        """
        step, leaf_id, command = moment.step, answer.leaf_id, answer.command
        if (
            step != self._step + 1
            or moment.episode != self._episode
            or moment.terminated
            or moment.truncated
            or (answer.leaf_count, answer.tree_hash) != self._trees[self._driver]
            or not 0 <= leaf_id < answer.leaf_count
            or not answer.active
            or not isfinite(sum(command))
        ):
            return None
        assert self._holding is not None
        reward = self._task.reward(moment)
        self._return += reward
        learns = self._learner is not None and self.parameters.learn and not self._degraded
        self._holding.hold(moment, (reward, self._command) if learns else None)
        self._steps += 1
        self._step = step
        self._command = command
        self._digest.add(self._task.digest_bytes(moment, command))
        return command

    def _hear(self, answers: Answers) -> tuple[JointState, Answers, bool]:
        """The joint state, the usable answers, and whether every answer is usable."""
        leaves: list[int] = []
        for answer, tree in zip(answers, self._trees):  # noqa: B905 - decide compares their numbers
            if answer is not None:
                leaf_id, leaf_count = answer.leaf_id, answer.leaf_count
                is_known = (leaf_count, answer.tree_hash) == tree
                if is_known and 0 <= leaf_id < leaf_count and isfinite(sum(answer.command)):
                    leaves.append(leaf_id)
                    continue
            heard = [self._check_answer(i, answer) for i, answer in enumerate(answers)]
            return tuple([NO_LEAF if x is None else x.leaf_id for x in heard]), heard, None not in heard
        return tuple(leaves), answers, True

    def _check_answer(self, i: int, answer: Answer | None) -> Answer | None:
        """The answer of behavior i, or None if it can't be used. Its first answer determines its tree."""
        if answer is None:
            return None
        if not 0 <= answer.leaf_id < answer.leaf_count:
            self.rejections.leaf_ids += 1
            return None
        if not all(map(isfinite, answer.command)):
            self.rejections.references += 1
            return None
        tree = (answer.leaf_count, answer.tree_hash)
        if self._trees[i] is None:
            given = self._given
            if given is not None and tree != (given.leaf_counts[i], given.tree_hashes[i]):
                raise BadInput(
                    f"the policy was learned with another tree of {self.behaviors[i]} (SHA-256 "
                    f"{given.tree_hashes[i][:12]}, {given.leaf_counts[i]} leaves) than the one that answers "
                    f"({answer.tree_hash[:12]}, {answer.leaf_count} leaves); use the trees it was learned with"
                )
            self._trees[i] = tree
        elif self._trees[i] != tree:
            self.rejections.trees += 1
            return None
        return answer

    def _close(self, moment: M) -> None:
        """Ends the episode and stores its record."""
        outcome = self._task.outcome(moment)
        episode = Episode(self._index, self.phase, self._seed, outcome, self._return, self._degraded)
        self.records.append(self._task.record(episode, moment))
        if self.phase is not Phase.GUIDED:
            self._counted += 1
            self._successes += outcome.success
        self._episode = -1
        self._step = maxsize

    def _why_out_of_order(self, episode: int, step: int) -> str:
        if self._episode < 0:
            return f"moment of episode {episode}, step {step}, but no episode has begun"
        if episode != self._episode:
            return f"moment of episode {episode}, step {step}, while episode {self._episode} is played"
        return f"moment of episode {episode}, step {step}, after step {self._step} was decided"

    def _load(self, policy: Policy) -> None:
        """Starts from a policy. Raises BadInput if it does not belong to this controller and these behaviors."""
        if self._learner is None:
            raise BadInput(f"controller '{self.parameters.controller}' takes no policy; leave the policy out")
        if policy.kind != self._learner.kind:
            raise BadInput(
                f"the policy belongs to controller '{policy.kind}', not to '{self._learner.kind}'; choose that controller"
            )
        if policy.behaviors != self.behaviors:
            raise BadInput(
                f"the policy fuses {', '.join(policy.behaviors)}, in this order; "
                f"the behaviors here are {', '.join(self.behaviors)}"
            )
        self._learner.load_arrays(policy.arrays)
