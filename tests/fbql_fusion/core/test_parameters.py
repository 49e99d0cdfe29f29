"""Fusion's parameters: their defaults are valid, and each wrong one is named."""

import pytest
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import limits_of
from fbql_fusion.core.parameters import FusionParameters, check_fusion, unused_parameters


def test_defaults_are_valid_and_every_parameter_is_described():
    check_fusion(FusionParameters(), "here")
    assert all(len(limits.description) > 5 for limits in limits_of(FusionParameters).values())


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"controller": "best"}, "'controller'"),
        ({"preset": "lucky"}, "'preset'"),
        ({"tie_rule": "last"}, "'tie_rule'"),
        ({"learning_rate": 1.5}, "'learning_rate'"),
        ({"discount": float("nan")}, "'discount'"),
        ({"guided": -2}, "'guided'"),
        ({"episodes": -1}, "'episodes'"),
        ({"seed": -1}, "'seed'"),
        ({"learn": 1}, "'learn'"),
        ({"behaviors": []}, "'behaviors' is empty"),
        ({"behaviors": ["ball_seeking", "wall-avoiding"]}, "'wall-avoiding', which can't be a topic's name"),
        ({"episodes": 2**63}, "'episodes'"),
        ({"behaviors": ["ball_seeking", "ball_seeking"]}, "'ball_seeking' twice"),
        ({"layers": ["ball_seeking", "ball_seeking"]}, "'ball_seeking' twice"),
        (
            {"layers": ["wall_avoiding", "aproaching"]},
            "'layers' has 'aproaching', which is not one of the behaviors (ball_",
        ),
        ({"layers": ["ball_seeking", "dribbling"]}, "'layers' has 'dribbling'"),
        ({"behaviors": ["dribbling"]}, "names none of the behaviors"),
        ({"weight_floor": 0.4}, "'weight_floor'"),
    ],
)
def test_a_wrong_parameter_is_refused_in_one_line_that_names_it(change, reason):
    with pytest.raises(BadInput) as refusal:
        check_fusion(FusionParameters(**change), "fusion.yaml")
    assert reason in str(refusal.value)
    assert str(refusal.value).startswith("fusion.yaml: ")
    assert "\n" not in str(refusal.value)


def test_the_usual_layers_may_stay_when_other_behaviors_are_fused() -> None:
    check_fusion(FusionParameters(behaviors=["ball_seeking", "dribbling"]), "fusion.yaml")
    check_fusion(FusionParameters(behaviors=["ball_seeking", "dribbling"], layers=["dribbling"]), "fusion.yaml")


@pytest.mark.parametrize(
    ("controller", "guided", "name", "line"),
    [
        ("fbql", True, "no_such", None),  # another node's
        ("fbql", True, "seed", None),
        ("fbql", True, "fbql_rate", None),
        ("fbql_model", True, "fbql_rate", None),
        (
            "fbql",
            True,
            "reward_collision",
            "reward_collision has no effect: the controller is fbql, whose own is fbql_reward_collision",
        ),
        ("fbql_literal", True, "reward_collision", None),
        ("fbql", True, "layers", None),  # Subsumption drives in guided episodes
        ("subsumption", False, "layers", None),
        (
            "fbql",
            False,
            "layers",
            "layers has no effect: it belongs to subsumption, the controller is fbql, and no episode is guided",
        ),
        (
            "fbql_value",
            True,
            "fbql_hold_s",
            "fbql_hold_s has no effect: it belongs to fbql, and the controller is fbql_value (whose own is fbql_value_hold_s)",
        ),
        (
            "uniform",
            True,
            "fbql_hold_s",
            "fbql_hold_s has no effect: it belongs to fbql, and the controller is uniform",
        ),
    ],
)
def test_a_parameter_without_effect_is_told_with_its_owner_and_what_has_one(
    controller: str, guided: bool, name: str, line: str | None
) -> None:
    found = list(unused_parameters(FusionParameters(controller=controller), [name], guided))
    assert found == ([] if line is None else [line])
