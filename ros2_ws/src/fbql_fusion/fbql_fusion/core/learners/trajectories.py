"""The decisions of whole episodes and their outcomes, from which the learners that hold their decisions learn."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from fbql_common.core.errors import BadInput
from numpy.typing import NDArray

from fbql_fusion.core.learners.features import Features, Situation
from fbql_fusion.core.learners.policy_arrays import check_arrays, check_range, rows_of

_THE_GUIDES = -1
"""The driver of a guided decision until its first step shows which behavior the guide chose."""


@dataclass
class Trajectory:
    """The decisions of one episode, in order, and the situation that it ended in."""

    guided: bool
    situations: list[Situation] = field(default_factory=list[Situation])
    """T + 1 situations, kept only until there are features for them."""
    rows: list[list[int]] = field(default_factory=list[list[int]])
    """Features of the T + 1 situations: those that are active, then those of the critic's further inputs."""
    drivers: list[int] = field(default_factory=list[int])
    """The behavior that drove after each of the T decisions."""
    old_probs: list[float] = field(default_factory=list[float])
    """The weight by which it was drawn."""
    rewards: list[float] = field(default_factory=list[float])
    """R of each decision."""
    discounts: list[float] = field(default_factory=list[float])
    """gamma^k of each decision, where k is the number of steps that it was held."""
    terminated: bool = False
    succeeded: bool = False
    """Whether it ended with a success."""
    masks: list[tuple[bool, ...]] = field(default_factory=list[tuple[bool, ...]])
    """Which behaviors could have driven, in each of the T + 1 situations."""

    def begin_decision(
        self, situation: Situation, row: list[int] | None, mask: tuple[bool, ...], driver: int, old_prob: float
    ) -> None:
        """Begins a decision. `row` holds its features; None as long as there are none."""
        self._add(situation, row, mask)
        self.drivers.append(_THE_GUIDES if self.guided else driver)
        self.old_probs.append(old_prob)
        self.rewards.append(0.0)
        self.discounts.append(1.0)

    def add_step(self, driver: int, reward: float, discount: float) -> bool:
        """Adds a step to the current decision. Returns False if no behavior drove, so that nothing can be learned from
        it."""
        if not self.drivers or driver < 0:
            return False
        if self.drivers[-1] == _THE_GUIDES:
            self.drivers[-1] = driver
        self.rewards[-1] += self.discounts[-1] * reward
        self.discounts[-1] *= discount
        return True

    def wait(self, reward: float, discount: float) -> None:
        """Adds a step in which no behavior could drive: its reward is credited to the decision before, if there was one."""
        if self.drivers:
            self.rewards[-1] += self.discounts[-1] * reward
            self.discounts[-1] *= discount

    def end(self, situation: Situation, row: list[int] | None, mask: tuple[bool, ...]) -> None:
        """Records the situation in which the episode ended."""
        self._add(situation, row, mask)

    def _add(self, situation: Situation, row: list[int] | None, mask: tuple[bool, ...]) -> None:
        self.masks.append(mask)
        if row is None:
            self.situations.append(situation)
        else:
            self.rows.append(row)


def minibatches(decisions: int, size: int, generator: np.random.Generator) -> Iterator[NDArray[np.int64]]:
    """The indices of all decisions in a random order, `size` at a time."""
    order = generator.permutation(decisions)
    for begin in range(0, decisions, size):
        yield order[begin : begin + size]


def to_arrays(trajectories: Sequence[Trajectory]) -> dict[str, NDArray[Any]]:
    """Trajectories not learned from yet: for E of them with N decisions in all, waiting_lengths int64 [E],
    waiting_terminated bool [E], waiting_active (the rows of `Trajectory`) int64 [N + E, F + F'], waiting_driver int64 [N],
    waiting_chance (`old_probs`), waiting_reward and waiting_discount float64 [N]; if some behavior could not drive at some time,
    waiting_mask bool [N + E, n] as well."""
    rows = [row for each in trajectories for row in each.rows]
    masks = np.array([mask for each in trajectories for mask in each.masks], dtype=np.bool_)
    arrays = {} if masks.all() else {"waiting_mask": masks}
    return {
        **arrays,
        "waiting_lengths": np.array([len(each.drivers) for each in trajectories], dtype=np.int64),
        "waiting_terminated": np.array([each.terminated for each in trajectories], dtype=np.bool_),
        "waiting_active": np.array(rows, dtype=np.int64).reshape(len(rows), -1 if rows else 0),
        "waiting_driver": np.array([x for each in trajectories for x in each.drivers], dtype=np.int64),
        "waiting_chance": np.array([x for each in trajectories for x in each.old_probs], dtype=np.float64),
        "waiting_reward": np.array([x for each in trajectories for x in each.rewards], dtype=np.float64),
        "waiting_discount": np.array([x for each in trajectories for x in each.discounts], dtype=np.float64),
    }


def from_arrays(arrays: Mapping[str, NDArray[Any]], features: Features, behaviors: int) -> list[Trajectory]:
    """The trajectories that `to_arrays` returned. Raises BadInput for arrays that can't come from it."""
    names = ("lengths", "terminated", "driver", "active", "chance", "reward", "discount")
    count, total = rows_of(arrays, "waiting_lengths"), rows_of(arrays, "waiting_driver")
    width = features.active_features + features.critic_features if count else 0
    shapes = ((count,), (count,), (total,), (count + total, width), (total,), (total,), (total,))
    kinds = zip("ibiifff", shapes, strict=True)
    check_arrays(arrays, {f"waiting_{name}": kind for name, kind in zip(names, kinds, strict=True)})
    check_range(arrays, "waiting_lengths", 1, total)
    check_range(arrays, "waiting_active", 0, len(features) - 1)
    check_range(arrays, "waiting_driver", 0, behaviors - 1)
    check_range(arrays, "waiting_chance", float(np.finfo(np.float64).tiny), 1.0)
    check_range(arrays, "waiting_discount", 0.0, 1.0)
    masks = np.ones((count + total, behaviors), dtype=np.bool_)
    if "waiting_mask" in arrays:
        check_arrays(arrays, {"waiting_mask": ("b", masks.shape)})
        masks = arrays["waiting_mask"]
    lengths, terminated, driver, active, *rest = (arrays[f"waiting_{name}"] for name in names)
    if sum(lengths.tolist()) != total:
        raise BadInput("the policy's arrays 'waiting_*' do not fit each other")
    trajectories: list[Trajectory] = []
    at = 0
    for i, length in enumerate(lengths.tolist()):
        own = slice(at, at + length)
        old_probs, rewards, discounts = (each[own].tolist() for each in rest)
        rows = active[at + i : at + i + length + 1].tolist()
        drivers = driver[own].tolist()
        mask = [tuple(each) for each in masks[at + i : at + i + length + 1].tolist()]
        if not any(mask[-1]) or not all(each[drawn] for each, drawn in zip(mask, drivers, strict=False)):
            raise BadInput("the policy's array 'waiting_mask' excludes a behavior that drove, or all of them")
        ended = bool(terminated[i])
        trajectories.append(Trajectory(False, [], rows, drivers, old_probs, rewards, discounts, ended, masks=mask))
        at += length
    return trajectories
