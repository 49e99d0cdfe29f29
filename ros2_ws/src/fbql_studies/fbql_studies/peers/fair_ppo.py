"""PPO with a network of its own that gets, one after the other, what fbql has: which of it makes the difference.

Needs neither Gymnasium nor torch.
"""

from __future__ import annotations

from dataclasses import dataclass

from fbql_studies.peers import ppo_settings
from fbql_studies.peers.ppo_settings import FBQL_PLAY_STEPS, PUBLISHED, PUBLISHED_HELD, PpoParameters, setting

PUBLISHED_PPO = "ppo, published defaults"
TUNED_PPO, TUNED_SENSED_PPO = "ppo, + tuned", "ppo, tuned, sensed critic"


@dataclass(frozen=True)
class FairPpo:
    """What PPO has of fbql. It always has fbql's senses and rewards, and never its guided episodes."""

    parameters: PpoParameters
    selects: bool = True
    """Whether one behavior drives alone; otherwise the action is the behaviors' weights."""
    mirrors: bool = True
    """Whether situations that mirror each other look alike."""
    informed: bool = True
    """Whether the critic sees what fbql's critic sees."""

    @property
    def play_holds(self) -> tuple[int, ...]:
        """For how many steps its actions may be held when it plays frozen: as in training, or as fbql's are."""
        return tuple(sorted({self.parameters.hold_steps, min(self.parameters.hold_steps, FBQL_PLAY_STEPS)}))


def tuned(informed: bool) -> int:
    """The number of the setting that the tuning chose."""
    return ppo_settings.TUNED_INFORMED if informed else ppo_settings.TUNED_SENSED


def of_setting(number: int, informed: bool) -> FairPpo:
    """PPO with everything, and a setting of those that are tried."""
    return FairPpo(setting(number), informed=informed)


STEPS: dict[str, FairPpo] = {
    PUBLISHED_PPO: FairPpo(PUBLISHED, selects=False, mirrors=False, informed=False),
    "ppo, + discrete choice": FairPpo(PUBLISHED, mirrors=False, informed=False),
    "ppo, + hold": FairPpo(PUBLISHED_HELD, mirrors=False, informed=False),
    "ppo, + mirror": FairPpo(PUBLISHED_HELD, informed=False),
    "ppo, + informed critic": FairPpo(PUBLISHED_HELD),
    TUNED_PPO: of_setting(tuned(informed=True), informed=True),
    TUNED_SENSED_PPO: of_setting(tuned(informed=False), informed=False),
}
"""Method -> what it has. Each has one part more than the one before it; the last lacks the informed critic."""
BEFORE = dict(zip([*STEPS][1:], [*STEPS][:-1], strict=True))
"""Method -> the one that it is compared with: the one before it."""
