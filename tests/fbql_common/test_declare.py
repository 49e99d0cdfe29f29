"""Parameters of the nodes: what is wrong is one line, naming the node, the parameter and what would be right."""

from pathlib import Path

import pytest
from fbql_behaviors.behavior_node import BehaviorNode, BehaviorNodeParameters
from fbql_common.core.errors import BadInput
from fbql_common.core.parameters import defaults_of, limits_of
from fbql_fusion.core.parameters import FusionParameters
from fbql_fusion.fusion_node import FusionNode
from fbql_fusion.node_parameters import FusionNodeParameters
from fbql_sim.core.parameters import SimulationParameters
from fbql_sim.simulator_node import SimulatorNode, SimulatorNodeParameters
from hand_driven import Partner, shipped_tree
from own_controller import bandit, only_ours
from rclpy.node import Node

NODES = {
    "simulator": (SimulatorNode, (SimulatorNodeParameters, SimulationParameters)),
    "behavior": (BehaviorNode, (BehaviorNodeParameters,)),
    "fusion": (FusionNode, (FusionNodeParameters, FusionParameters)),
}


@pytest.fixture
def refused(bench, tmp_path, monkeypatch):
    """Makes a node with arguments that it must refuse; gives the one line it says."""
    monkeypatch.chdir(tmp_path)

    def make(name, *arguments):
        with pytest.raises(BadInput) as refusal:
            bench.add(lambda **options: NODES[name][0](cli_args=["--ros-args", *arguments], **options))
        text = str(refusal.value)
        assert "\n" not in text
        assert not list(tmp_path.iterdir()), "something was made before the parameters were checked"
        return text

    return make


@pytest.mark.parametrize("name", NODES)
def test_misspelt_parameter_is_refused_naming_the_known_ones(refused, bench, name):
    text = refused(name, "-p", "spede:=1.0")
    assert text.startswith(f"{bench.namespace}/{name}: unknown parameter 'spede'; known are: ")
    for declaration in NODES[name][1]:
        assert all(known in text for known in limits_of(declaration))


@pytest.mark.parametrize(
    ("name", "parameter", "value", "said"),
    [
        ("simulator", "dt_s", "1", "must be double, not integer 1; write 1.0"),
        ("simulator", "dt_s", "fast", "must be double, not string 'fast'"),
        ("simulator", "seed", "1.0", "must be integer, not double 1.0"),
        ("simulator", "max_steps", "[1, 2]", "must be integer, not integer_array [1, 2]"),
        ("behavior", "tree_file", "5", "must be string, not integer 5; put it in quotes"),
        (
            *("behavior", "tree_file", "y"),
            "must be string, not bool True; put it in quotes, without which YAML takes y, n, yes, no, on and off for bools",
        ),
        ("fusion", "record", "1", "must be bool, not integer 1"),
        ("fusion", "behaviors", "wall_avoiding", "must be string_array, not string 'wall_avoiding'"),
        ("fusion", "behaviors", "[]", "must be string_array, not empty"),
    ],
)
def test_parameter_of_a_wrong_type_is_refused_naming_the_right_one(refused, bench, name, parameter, value, said):
    assert refused(name, "-p", f"{parameter}:={value}") == f"{bench.namespace}/{name}: parameter '{parameter}' {said}"


@pytest.mark.parametrize("value", [".nan", ".inf", "-.inf"])
@pytest.mark.parametrize(("name", "parameter"), [("simulator", "dt_s"), ("fusion", "learning_rate")])
def test_parameter_that_is_not_finite_is_refused(refused, name, parameter, value):
    assert f"parameter '{parameter}' is {float(value.replace('.', ''))}, outside of [" in refused(
        name, "-p", f"{parameter}:={value}"
    )


def outside():
    """Every bounded parameter of every node with a value just outside of each of its bounds."""
    for name, (_, declarations) in NODES.items():
        for declaration in declarations:
            defaults = defaults_of(declaration)
            for parameter, limits in limits_of(declaration).items():
                for bound, direction in ((limits.low, -1), (limits.high, 1)):
                    if bound is None or abs(bound) > 2**53:
                        continue
                    is_float = type(defaults[parameter]) is float
                    value = bound + direction * 1e-9 * max(abs(bound), 1.0) if is_float else int(bound) + direction
                    yield pytest.param(name, parameter, value, id=f"{name}-{parameter}-{value:g}")


@pytest.mark.parametrize(("name", "parameter", "value"), list(outside()))
def test_parameter_just_out_of_its_range_is_refused(refused, name, parameter, value):
    assert f"parameter '{parameter}' is {value!r}, outside of [" in refused(name, "-p", f"{parameter}:={value!r}")


@pytest.mark.parametrize(("parameter", "value"), [("controller", "magic"), ("preset", "best"), ("tie_rule", "last")])
def test_parameter_that_is_no_choice_is_refused_naming_the_choices(refused, parameter, value):
    text = refused("fusion", "-p", f"{parameter}:={value}")
    choices = limits_of(FusionParameters)[parameter].choices
    assert text.endswith(f"parameter '{parameter}' is '{value}'; choose one of: {', '.join(choices)}")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["behaviors:=[a, a]"], "names 'a' twice"),
        (["layers:=[wall_avoiding, wall_avoiding]"], "names 'wall_avoiding' twice"),
        (["behaviors:=[a, b]"], "names none of the behaviors"),
        (["weight_floor:=0.5"], "3 behaviors leave at most 0.333333"),
        (["policy:=/nowhere/policy.npz"], "/nowhere/policy.npz: no such file"),
        (["run_directory:=/proc/run"], "/proc/run: can't create the run directory"),
    ],
)
def test_fusion_parameters_that_do_not_go_together_are_refused(refused, arguments, said):
    assert said in refused("fusion", *(part for argument in arguments for part in ("-p", argument)))


def test_behavior_without_a_tree_is_refused_saying_how_to_name_one(refused):
    assert "tree_file:=FILE" in refused("behavior")


def test_tree_file_that_is_none_is_refused_naming_it(refused):
    assert refused("behavior", "-p", "tree_file:=/dev/null").startswith("/dev/null: ")


@pytest.mark.parametrize("name", NODES)
def test_every_parameter_tells_its_meaning_and_is_frozen(bench, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    make, declarations = NODES[name]
    given = {"tree_file": str(shipped_tree("approaching"))} if name == "behavior" else {}
    node: Node = bench.add(make, **given)
    for declaration in declarations:
        for parameter, limits in limits_of(declaration).items():
            descriptor = node.describe_parameter(parameter)
            assert limits.description in descriptor.description
            assert descriptor.read_only
            # rclpy cannot say that a list of texts is empty.
            assert defaults_of(declaration)[parameter] == [] or node.get_parameter(parameter).value is not None


def test_parameter_file_sets_what_it_names_and_leaves_the_rest(bench, tmp_path):
    path = tmp_path / "parameters.yaml"
    path.write_text("/**:\n  ros__parameters:\n    max_steps: 77\n    realtime: 2.5\n")
    node = bench.add(
        lambda **options: SimulatorNode(cli_args=["--ros-args", "--params-file", str(path)], **options), seed=3
    )
    assert [node.get_parameter(name).value for name in ("max_steps", "realtime", "seed")] == [77, 2.5, 3]
    assert node.get_parameter("dt_s").value == SimulationParameters().dt_s


def test_empty_list_in_a_parameter_file_is_an_empty_list(bench, tmp_path):
    path = tmp_path / "parameters.yaml"
    path.write_text(f"/**:\n  ros__parameters:\n    tree_files: []\n    run_directory: {tmp_path}/run\n")
    node = bench.add(lambda **options: FusionNode(cli_args=["--ros-args", "--params-file", str(path)], **options))
    assert node._settings.tree_files == []


@pytest.mark.parametrize("name", NODES)
def test_node_hides_nothing_of_what_it_inherits(bench, tmp_path, monkeypatch, name):
    monkeypatch.chdir(tmp_path)
    given = {"tree_file": str(shipped_tree("approaching"))} if name == "behavior" else {}
    node, plain = bench.add(NODES[name][0], **given), bench.add(Partner)
    hidden = [inherited for inherited, value in vars(plain).items() if type(vars(node)[inherited]) is not type(value)]
    assert not hidden
    assert not set(vars(NODES[name][0])) & set(dir(Node)) - set(vars(object)) - {"__module__", "__annotations__"}


def test_a_parameter_that_two_parts_declare_is_refused(refused, tmp_path_factory):
    source = bandit(tmp_path_factory.mktemp("own"))
    path = Path(source.rpartition(":")[0])
    path.write_text(path.read_text().replace("bandit_random", "record"))
    with only_ours():
        text = refused("fusion", "-p", f"controller_file:={source}", "-p", "controller:=Bandit")
    assert text.endswith("/fusion: parameter 'record' is declared by two parts; rename your own")
