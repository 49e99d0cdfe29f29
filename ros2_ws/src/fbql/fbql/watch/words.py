"""A sentence that explains the command of a moment, as the report's page does, but short enough to read during play."""

from __future__ import annotations

from fbql_behaviors.core.explanation import motion_of, speed_of
from fbql_common.core.types import Decision, Phase, WheelCommand

from fbql.cli.words import percent
from fbql.watch.moments import Moments


def why(moments: Moments) -> str:
    """The sentence; empty before there is a decision."""
    decision, world = moments.decision, moments.world
    if decision is None or world is None:
        return ""
    if world.ended:
        return f"The episode ends here: {'goal' if world.goal else 'own goal' if world.own_goal else 'timeout'}."
    guided = " (the guide's choice)" if decision.phase == Phase.GUIDED else ""
    so = f" So the command is: {motion_text(moments.command)}." if moments.command else ""
    if 0 <= decision.driver < len(decision.behaviors):
        name = decision.behaviors[decision.driver]
        rule = moments.rule(name)
        reason = "" if rule is None else f", because of its rule: {rule.where} -> {rule.what}"
        return f"{name} drives alone{guided}{reason}.{so}"
    parts = [_part(moments, name, weight) for name, weight in _by_weight(decision)]
    if not parts:
        return f"Nobody drives: no behavior has any weight.{so}"
    return f"They drive together{guided}: {' + '.join(parts)}.{so}"


def motion_text(command: WheelCommand) -> str:
    """What a command does, such as `fast forwards, turning left`."""
    wheels = command.left_rad_s, command.right_rad_s
    return f"{speed_of(*wheels)} {motion_of(*wheels).value}".strip()


def _part(moments: Moments, name: str, weight: float) -> str:
    rule = moments.rule(name)
    return f"{name} {percent(weight)}" + (f" ({rule.what})" if rule else "")


def _by_weight(decision: Decision) -> list[tuple[str, float]]:
    weighted = [each for each in zip(decision.behaviors, decision.weights, strict=False) if each[1] > 0.0]
    return sorted(weighted, key=lambda each: -each[1])
