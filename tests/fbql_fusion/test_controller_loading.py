"""Controllers of a user's own: found by file or entry point, with their parameters, and every fault of theirs is one line."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict, dataclass, replace
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fbql_common import own_code
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import from_mapping, limits_of, parameter
from fbql_fusion.controller_loading import resolve_controller
from fbql_fusion.core.controllers.parameters import CONTROLLERS
from fbql_fusion.core.parameters import FusionParameters, unused_parameters
from fbql_fusion.core.registry import fusion_parameters, learns, register_controller, source_file
from fbql_fusion.core.soccer_session import SoccerSession
from own_controller import NOT_SAVED, bandit, only_ours
from two_sides import BEHAVIORS, parameters, play


@pytest.fixture(autouse=True)
def clean() -> Iterator[None]:
    """No test leaves a controller behind."""
    with only_ours():
        yield


def written(directory: Path, text: str, name: str = "own.py") -> Path:
    path = directory / name
    path.write_text(text)
    return path


def values(**changes: Any) -> dict[str, Any]:
    return {**asdict(parameters()), "controller": "Bandit", **changes}


def test_a_controller_of_a_file_plays_learns_and_takes_its_own_parameters(tmp_path: Path) -> None:
    known = resolve_controller(bandit(tmp_path))
    assert known == ("Bandit", f"{tmp_path / 'bandit.py'}:Bandit")
    given = from_mapping(fusion_parameters("Bandit"), values(bandit_rate=0.5), "here")
    assert learns(given)
    session = SoccerSession(given)
    play(session, 12)
    policy = session.policy()
    assert policy is not None
    assert policy.kind == "Bandit"
    assert policy.arrays["values"].any()
    slow = SoccerSession(from_mapping(fusion_parameters("Bandit"), values(bandit_rate=0.001), "here"))
    play(slow, 12)
    slower = slow.policy()
    assert slower is not None
    assert np.abs(slower.arrays["values"]).max() < np.abs(policy.arrays["values"]).max()
    frozen = SoccerSession(from_mapping(fusion_parameters("Bandit"), values(learn=False), "here"), policy)
    play(frozen, 3)
    again = frozen.policy()
    assert again is not None
    assert np.array_equal(again.arrays["values"], policy.arrays["values"])


def test_the_same_seed_plays_the_same(tmp_path: Path) -> None:
    resolve_controller(bandit(tmp_path))
    digests: list[str] = []
    for seed in (1, 1, 2):
        session = SoccerSession(from_mapping(fusion_parameters("Bandit"), values(seed=seed, bandit_random=1.0), "here"))
        play(session, 4)
        digests.append(session.digest)
    assert digests[0] == digests[1] != digests[2]


def test_a_file_with_one_controller_needs_no_name(tmp_path: Path) -> None:
    assert resolve_controller(bandit(tmp_path).removesuffix(":Bandit")).name == "Bandit"


def test_a_file_that_was_edited_is_played_as_it_is_now(tmp_path: Path) -> None:
    chosen: list[int] = []
    for driver in (0, 1, 0):
        path = written(tmp_path, NOT_SAVED.replace("self.weights, -1", f"self.weights, {driver}"))
        resolve_controller(str(path))
        chosen.append(play(SoccerSession(replace(parameters(), controller="A")), 1)[0].driver)
    assert chosen == [0, 1, 0], "the texts are of one length, written within a second"


def test_own_parameters_are_checked_and_belong_to_it_alone(tmp_path: Path) -> None:
    resolve_controller(bandit(tmp_path))
    register_controller("other", lambda *_: None, Other)
    assert fusion_parameters("uniform") is FusionParameters
    assert "bandit_rate" not in limits_of(fusion_parameters("other"))
    with pytest.raises(BadInput, match=r"'bandit_rate' is 2\.0, outside of"):
        from_mapping(fusion_parameters("Bandit"), values(bandit_rate=2.0), "here")
    assert limits_of(fusion_parameters("Bandit"))["bandit_rate"].owners == ("Bandit",)
    own = from_mapping(fusion_parameters("Bandit"), values(), "here")
    assert list(unused_parameters(own, ["bandit_rate", "fbql_rate"], guided=False)) == [
        "fbql_rate has no effect: it belongs to fbql and fbql_model, and the controller is Bandit"
    ]
    assert list(unused_parameters(replace(own, controller="uniform"), ["bandit_rate"], guided=False)) == [
        "bandit_rate has no effect: it belongs to Bandit, and the controller is uniform"
    ]


def test_a_function_registered_from_python_gets_all_parameters() -> None:
    seen: list[Any] = []

    class Last:
        def begin_episode(self, phase: Any) -> None: ...

        def select(self, world: Any, joint_state: Any, outputs: Any) -> Any:
            return (0.0, 1.0), 1, (), ()

    def make(given: Any, generator: np.random.Generator) -> Last:
        seen.append((given, generator))
        return Last()

    register_controller("last", make)
    session = SoccerSession(replace(parameters(), controller="last"))
    decisions = play(session, 1)
    assert {decision.driver for decision in decisions} == {1}
    assert session.policy() is None
    assert isinstance(seen[0][0], FusionParameters)
    assert isinstance(seen[0][1], np.random.Generator)


@pytest.mark.parametrize(
    ("text", "name", "reason"),
    [
        (
            "class A:\n    def select(self): ...\nclass B(A): ...\n",
            "",
            "which controller? write own.py:NAME; it has: A, B",
        ),
        ("x = 1\n", "", "it has no class with a method 'select'"),
        ("x = 1\n", ":Nobody", "there is no 'Nobody' in it"),
        ("x = 1\n", ":x", "controller 'x': a int is not a class or a function"),
        ("1 / 0\n", ":x", "ZeroDivisionError in line 1: division by zero"),
        ("def f(:\n", ":f", "SyntaxError in line 1"),
        ("class fbql: ...\n", ":fbql", "this package has a controller of that name"),
        ("class A:\n    Parameters = 3\n", ":A", "its Parameters must be a dataclass"),
        ("class A:\n    class Parameters: ...\n", ":A", "its Parameters must be a dataclass"),
        (
            "from dataclasses import dataclass\n@dataclass\nclass P: ...\nclass A:\n    Parameters = P()\n",
            ":A",
            "its Parameters must be a dataclass",
        ),
        (
            "from dataclasses import dataclass\nfrom fbql_common.core.parameters import parameter\n"
            "class A:\n    @dataclass\n    class Parameters:\n        a: 'Nobody' = parameter(1, 'a')\n",
            ":A",
            "its Parameters can't be used (name 'Nobody' is not defined)",
        ),
        (
            "from dataclasses import dataclass\nfrom fbql_common.core.parameters import parameter\n"
            "class A:\n    @dataclass\n    class Parameters:\n        seed: int = parameter(0, 'another seed')\n",
            ":A",
            "fusion has a parameter 'seed' already; choose another name",
        ),
        (
            "from dataclasses import dataclass\nclass A:\n    @dataclass\n    class Parameters:\n        a: int = 1\n",
            ":A",
            "declare its parameter 'a' with parameter(...)",
        ),
    ],
)
def test_what_is_wrong_with_a_file_is_one_line(tmp_path: Path, text: str, name: str, reason: str) -> None:
    path = written(tmp_path, text)
    with pytest.raises(BadInput) as refused:
        resolve_controller(f"{path}{name}")
    assert str(refused.value).startswith(f"{path}: ")
    assert reason in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("class A: ...\n", "A() takes no arguments"),
        ("class A:\n    def __init__(self, p, g): ...\n", "a A has no method 'begin_episode'"),
        (
            "class A:\n    def __init__(self, p, g): ...\n    def begin_episode(self, phase): ...\n"
            "    def select(self, *_): ...\n    def learn(self, t): ...\n",
            "has no method 'to_arrays'; one that learns has learn, to_arrays, load_arrays",
        ),
        ("return 1 / 0", "ZeroDivisionError in line 4: division by zero"),
        ("return 5", "'select' returns a int; expected (weights, driver, q, learned weights)"),
        ("return (1.0, 0.0), 7, (), ()", "'select' returns driver 7; expected the index of a behavior"),
        ("return (1.0,), 0, (), ()", "'select' returns weights (1.0,); expected 2 finite numbers"),
        ("return (1.0, 0.0), 0, (1.0,), ()", "'select' returns q (1.0,); expected 2 finite numbers or none"),
        ("return (1.0, 'b'), 0, (), ()", "'select' returns weights (1.0, 'b')"),
        ("return None, 0, (), ()", "'select' returns weights that are a NoneType"),
        ("return (float('nan'), 0.0), 0, (), ()", "'select' returns weights (nan, 0.0); expected 2 finite numbers"),
        (
            "return (1.0, 0.0), -1, (0.0, float('inf')), ()",
            "'select' returns q (0.0, inf); expected 2 finite numbers or none",
        ),
        ("return (1.0, 10**400), 0, (), ()", "expected 2 finite numbers"),
    ],
)
def test_what_is_wrong_with_a_controller_is_one_line(tmp_path: Path, text: str, reason: str) -> None:
    if text.startswith("return"):
        text = (
            "class A:\n    def __init__(self, p, g): ...\n    def select(self, world, joint_state, outputs):\n"
            f"        {text}\n    def begin_episode(self, phase): ...\n"
        )
    resolve_controller(f"{written(tmp_path, text)}:A")
    with pytest.raises(BadInput) as refused:
        play(SoccerSession(replace(parameters(), controller="A")), 1)
    assert reason in str(refused.value)
    assert str(refused.value).startswith("controller 'A': ")
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("learned", "reason"),
    [
        ("1 / 0", "ZeroDivisionError in line 14: division by zero"),
        ("None", "'to_arrays' gives a NoneType; expected a dict of name -> array"),
        ("{3: np.zeros(2)}", "'to_arrays' gives a int as a name; expected a text"),
        ("{'values': [1.0]}", "'to_arrays' gives 'values' as a list; expected an array of numbers"),
        ("{'values': np.array(['a'])}", "'to_arrays' gives 'values' as an array of <U1; expected an array of numbers"),
        (
            "{'values': np.array([None])}",
            "'to_arrays' gives 'values' as an array of object; expected an array of numbers",
        ),
    ],
)
def test_what_is_wrong_with_what_was_learned_is_one_line(tmp_path: Path, learned: str, reason: str) -> None:
    resolve_controller(f"{written(tmp_path, NOT_SAVED.replace('LEARNED', learned))}:A")
    session = SoccerSession(replace(parameters(), controller="A"))
    play(session, 1)
    with pytest.raises(BadInput) as refused:
        session.policy()
    assert str(refused.value) == f"controller 'A': {reason}"


@dataclass(frozen=True)
class Other:
    bandit_random: float = parameter(0.7, "its own, whatever others declare", low=-1.0)


def test_a_parameter_that_is_there_already_is_refused() -> None:
    @dataclass(frozen=True)
    class Clash:
        fbql_rate: float = parameter(0.7, "another meaning", low=0.0)

    with pytest.raises(BadInput, match="controller 'mine': fusion has a parameter 'fbql_rate' already"):
        register_controller("mine", lambda *_: None, Clash)


def test_an_installed_controller_is_found_by_its_name(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    bandit(tmp_path)
    monkeypatch.syspath_prepend(tmp_path)
    entries = [EntryPoint("bandit", "bandit:Bandit", "fbql.controllers")]
    monkeypatch.setattr(own_code, "entry_points", lambda group, name: [x for x in entries if x.name == name])
    assert resolve_controller("bandit") == ("bandit", "")
    assert SoccerSession(from_mapping(fusion_parameters("bandit"), values(controller="bandit"), "here"))
    assert source_file("bandit") == str(tmp_path / "bandit.py")
    entries.append(EntryPoint("other", "nowhere:Bandit", "fbql.controllers"))
    with pytest.raises(BadInput, match=r"entry point fbql.controllers: other = nowhere:Bandit: ModuleNotFoundError"):
        resolve_controller("other")
    entries.append(EntryPoint("other", "elsewhere:Bandit", "fbql.controllers"))
    with pytest.raises(BadInput, match="controller 'other' is installed twice"):
        resolve_controller("other")


def test_an_unknown_controller_names_those_that_are_known() -> None:
    with pytest.raises(
        BadInput, match=r"unknown controller 'magic'; choose one of: fbql, .*; or FILE.py:NAME for your own"
    ):
        resolve_controller("magic")
    assert "magic" not in CONTROLLERS
    assert len(BEHAVIORS) == 2
