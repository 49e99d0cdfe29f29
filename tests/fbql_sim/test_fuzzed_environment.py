"""Whatever is called on the Gymnasium environment, in whatever order: it plays as the world's loop does, or refuses in one
line and nothing has moved."""

from __future__ import annotations

import copy
import pickle
import random
from collections.abc import Callable
from decimal import Decimal
from typing import Any

import numpy as np
import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.field import MAX_WHEEL_RAD_S
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.core.world_loop import WorldLoop
from fuzzing import dice, odd_number, odd_value, odd_word

gymnasium = pytest.importorskip("gymnasium", reason="an optional extra, which is in requirements/test.txt")
CALLS = 40
DTYPES = ("f2", "f4", "f8", "g", ">f8", "i1", "i8", "u1", "u8", "?", "c16", "O", "U5", "M8[s]", "m8[s]")
NUMBERS = (0.0, -0.0, 0.3, 1.0, -1.0, 1.5, -7.0, 1e-320, 1e30, 1e308, -1e308, float("nan"), float("inf"))


def odd_action(rng: random.Random) -> Any:
    """Two numbers, or anything but."""
    pair = [rng.choice(NUMBERS), rng.choice(NUMBERS)]
    how = rng.randrange(10)
    if how < 3:
        return rng.choice((list, tuple, np.array))(pair)
    if how < 5:
        with np.errstate(all="ignore"):
            try:
                return np.array(pair).astype(rng.choice(DTYPES))
            except (ValueError, OverflowError):
                return None
    if how == 5:
        shape = rng.choice(((), (0,), (1,), (3,), (2, 1), (1, 2), (2, 2), (1,) * 32))
        return np.full(shape, pair[0])
    if how == 6:
        mask = [rng.random() < 0.5, rng.random() < 0.5]
        return rng.choice(
            (np.ma.array(pair, mask=mask), range(2), b"ab", bytearray(2), memoryview(bytes(2)), iter(pair))
        )
    if how == 7:
        return [odd_number(rng), odd_number(rng)]
    if how == 8:
        return [rng.choice((Decimal(1), True, "1", None, [0.0], object(), 10**400, 1j, np.float16(1))), pair[1]]
    return odd_value(rng)


def expected(action: Any) -> tuple[float, float] | None:
    """The wheel velocities of an action, by other means; None where it is not two finite numbers."""
    try:
        values = np.asarray(action)
    except ValueError:
        return None
    if values.shape != (2,) or values.dtype.kind not in "fiu":
        return None
    shares = [float(value) for value in values]
    if not all(np.isfinite(shares)):
        return None
    left, right = (min(max(share, -1.0), 1.0) * MAX_WHEEL_RAD_S for share in shares)
    return left, right


def refused(call: Callable[[], Any], *kinds: type[Exception]) -> bool:
    """Whether a call is refused in one line."""
    try:
        call()
    except kinds as error:
        assert str(error).isprintable() and str(error)
        return True
    return False


def begin(rng: random.Random, env: Any, loop: WorldLoop, episode: int, max_steps: int) -> bool:
    """A reset, seeded or with options, on both sides. Returns whether an episode began."""
    seed = rng.choice((None, None, 0, 7, 2**31, 2**63, -1, 1.5, True, "1", np.int64(3), odd_number(rng)))
    options = rng.choice((None, None, {}, {"episode_seed": rng.choice((0, 5, 2**63 - 1, np.int64(3), np.uint8(3)))}))
    if rng.random() < 0.2:
        options = rng.choice((odd_value(rng), {"episode_seed": odd_value(rng)}, {odd_word(rng): 1, "episode_seed": 1}))
    found: list[Any] = []
    if refused(lambda: found.append(env.reset(seed=seed, options=options)), BadInput, gymnasium.error.Error, TypeError):
        return False
    [(observation, info)] = found
    world = loop.reset(episode, info["episode_seed"])
    assert observation in env.observation_space
    assert env.world == world
    if options and options.get("episode_seed") is not None:
        assert info["episode_seed"] == options["episode_seed"]
    return True


def test_calls_in_any_order_play_as_the_world_does_or_are_refused():
    import fbql_sim.gymnasium_env as module

    for rng in dice(25):
        max_steps, hold_steps = rng.choice((1, 3, 20, 4000)), rng.choice((1, 1, 2, 7))
        env: Any = module.WheelsEnv(max_steps=max_steps, hold_steps=hold_steps)
        loop = WorldLoop(SimulationParameters(max_steps=max_steps))
        episode, running = 0, False
        for _ in range(CALLS):
            before = env.world if episode else None
            how = rng.randrange(10)
            if how < 2:
                if begin(rng, env, loop, episode, max_steps):
                    episode, running = episode + 1, True
                else:
                    assert not episode or env.world == before
            elif how < 9:
                action = odd_action(rng)
                command = expected(action)
                found: list[Any] = []
                if refused(lambda: found.append(env.step(action)), ValueError, RuntimeError):  # noqa: B023
                    assert command is None or not running, action
                    assert not episode or env.world == before
                    continue
                assert command is not None and running, action
                for _ in range(hold_steps):
                    world = loop.step(*command)
                    if world.ended:
                        break
                [(observation, reward, terminated, truncated, _)] = found
                assert env.world == world, action
                assert (terminated, truncated) == (world.terminated, world.truncated)
                assert observation in env.observation_space
                assert type(reward) is float
                running = not world.ended
            else:
                env = rng.choice((copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))))(env)
                assert env.render() is None
                if rng.random() < 0.2:
                    env.close()


def test_odd_parameters_make_an_environment_that_plays_or_are_refused():
    import fbql_sim.gymnasium_env as module

    names = [*module.limits_of(module.EnvironmentParameters), *module.limits_of(SimulationParameters), "render_mode"]
    numbers = (
        0,
        1,
        -1,
        2,
        0.5,
        1e-9,
        1e9,
        -1e9,
        1e308,
        float("nan"),
        float("inf"),
        np.float64(0.5),
        np.int64(3),
        10**400,
        10**5000,
    )
    for rng in dice(60):
        given: dict[str, Any] = {}
        for _ in range(rng.choice((1, 1, 2, 3))):
            name = rng.choice(names) if rng.random() < 0.9 else rng.choice(("", "x", "self", "hold", odd_word(rng)))
            given[name] = rng.choice(numbers) if rng.random() < 0.7 else odd_value(rng)
        made: list[Any] = []
        if refused(lambda: made.append(module.WheelsEnv(**given)), BadInput, TypeError):  # noqa: B023
            continue
        [env] = made
        env.parameters = module.EnvironmentParameters(hold_steps=1)
        observation, _ = env.reset(seed=1)
        for _ in range(3):
            assert observation in env.observation_space, given
            observation, reward, terminated, truncated, _ = env.step([1.0, 0.5])
            assert np.isfinite(reward)
            if terminated or truncated:
                break
