"""Lesson 4: how often equations 5 and 6 have nothing to choose from, and what decides instead."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from fbql_common.core.errors import BadInput
from fbql_common.core.plain_json import json_from
from fbql_common.files import read_file
from fbql_fusion.core.learners.literal.equations import count_ties
from fbql_fusion.core.learners.literal.learner import FbqlLiteral
from fbql_fusion.policy_storage import load_policy

from fbql.cli.words import percent
from fbql.course.verdict import Verdict, made, number_of, words_of

PRINTED, EQUAL, FIRST = "printed", "equal", "first"
"""The runs: eqs. 5 and 6 where a tie changes nothing, equal weights, and eqs. 5 and 6 where the first behavior wins a tie."""
CLOSE = 0.5
"""How far a percentage may be off."""
_MOST_BYTES = 2**20


class Table(NamedTuple):
    """What `fbql_literal` has learned, in numbers."""

    states: int
    """Joint states that it learned about."""
    tied: int
    """Those of them in which all Q are equal."""
    favorite: str
    """The behavior with the largest mean weight; several where they are equal."""
    weight: float
    """That weight."""

    @property
    def percent(self) -> float:
        """Share of the tied ones [%]."""
        return 100.0 * self.tied / self.states


def check(answer: Sequence[str], work: Path) -> Verdict:
    """Compares the answer PERCENT BEHAVIOR with the policy, and the digests of two runs."""
    share, behavior = words_of(answer, "PERCENT BEHAVIOR", "50 ball_seeking")
    given = number_of(share, "the percentage")
    digests = [_digest(work / name) for name in (PRINTED, EQUAL)]
    if digests[0] != digests[1]:
        return Verdict(
            False,
            f"{PRINTED} and {EQUAL} have different digests, {digests[0][:8]} and {digests[1][:8]}; play both with the same "
            f"--seed, --episodes and --max-steps, and {PRINTED} with --guided 0 and without --set",
        )
    table = table_of(work / FIRST)
    if abs(given - table.percent) > CLOSE:
        hint = "count the rows of q in which all three numbers are equal, and divide by the number of rows"
        if abs(100.0 * given - table.percent) <= CLOSE:
            hint = "that is a fraction of 1; write it in percent"
        elif abs(100.0 - given - table.percent) <= CLOSE:
            hint = "that is the share of the joint states that are not tied"
        return Verdict(False, f"{given:g} % of the joint states is not what the policy of {FIRST} has: {hint}")
    if behavior != table.favorite:
        return Verdict(
            False,
            f"the share is right, but {behavior} does not have the largest mean weight: average the columns of weights; they are "
            "in the order of the behaviors",
        )
    return Verdict(
        True,
        f"of the {table.states} joint states that it met, {percent(table.tied / table.states)} have the same Q for every "
        f"behavior, to the last bit; there the tie rule alone moved the weights, and {table.favorite} has {table.weight:.2f} on "
        f"average; where a tie changes nothing, the match was that of equal weights (digest {digests[0][:8]})",
    )


def table_of(run: Path) -> Table:
    """The policy of a run of `fbql_literal` in numbers. Raises BadInput."""
    policy = load_policy(made(run / "policy.npz"))
    if policy.kind != FbqlLiteral.kind:
        raise BadInput(f"{run / 'policy.npz'}: a policy of {policy.kind}; play with --controller {FbqlLiteral.kind}")
    q, weights = policy.arrays["q"], policy.arrays["weights"]
    if not len(q):
        raise BadInput(f"{run / 'policy.npz'}: it has learned nothing; play some episodes")
    mean = weights.mean(axis=0)
    best = [name for name, weight in zip(policy.behaviors, mean, strict=True) if weight == mean.max()]
    return Table(len(q), count_ties(q.tolist()), ", ".join(best), float(mean.max()))


def _digest(run: Path) -> str:
    path = made(run / "summary.json")
    summary = json_from(read_file(path, _MOST_BYTES))
    digest = summary.get("digest") if isinstance(summary, dict) else None
    if not isinstance(digest, str):
        raise BadInput(f"{path}: it has no digest; play the run again")
    return digest
