"""Two simulators or two fusion nodes in one graph: the second ends and says so, and nothing is learned from both."""

import json
import signal

import pytest
from bringup_run import Run
from fbql_common.core.topic_names import WHEEL_COMMAND
from fbql_common.core.types import WheelCommand
from fbql_common.spin import DONE, FAILED
from fbql_fusion.fusion_node import FusionNode
from fbql_sim.simulator_node import SimulatorNode
from hand_driven import FakeBehavior, FakeSimulator, Partner, listen

SOON_S = 30.0
"""About two on an idle machine, from the start of the process."""


@pytest.mark.parametrize("name", ["simulator", "another_one"])
def test_a_second_simulator_ends_and_names_the_first_under_any_name(start_node, bench, name):
    space = ("-r", f"__ns:={bench.namespace}")
    first = start_node("fbql_sim", "simulator", "--ros-args", *space)
    first.until_printed("simulator: lockstep")
    second = start_node("fbql_sim", "simulator", "--ros-args", *space, "-r", f"__node:={name}")
    assert second.exit_code(SOON_S) == FAILED
    assert f"another simulator runs in this graph: '{bench.namespace}/simulator'" in second.printed()
    assert "[ERROR]" in second.printed()
    assert first.popen.poll() is None
    first.send(signal.SIGINT)
    assert first.exit_code() == DONE, first.printed()


def test_a_simulator_takes_the_place_of_one_that_was_killed(start_node, bench):
    """The killed one stays in the graph for 20 s."""
    space = ("--ros-args", "-r", f"__ns:={bench.namespace}")
    first = start_node("fbql_sim", "simulator", *space)
    partner = bench.add(Partner)
    bench.until(lambda: partner.count_publishers("world") == 1, "the first simulator")
    first.send(signal.SIGKILL)
    first.exit_code()
    second = start_node("fbql_sim", "simulator", *space)
    bench.until(
        lambda: partner.count_publishers("world") == 2, "the second simulator, beside what is left of the first"
    )
    bench.until(lambda: partner.count_publishers("world") == 2 and second.popen.poll() is None, "that it lives")
    second.send(signal.SIGINT)
    assert second.exit_code() == DONE, second.printed()
    assert "[ERROR]" not in second.printed()


def test_a_second_fusion_node_ends_and_names_the_first(start_node, bench, tmp_path):
    space = ("-r", f"__ns:={bench.namespace}")

    def fusion(name):
        words = ("-r", f"__node:={name}", "-p", f"run_directory:={tmp_path / name}")
        return start_node("fbql_fusion", "fusion", "--ros-args", *space, *words)

    first = fusion("fusion")
    first.until_printed("; run in ")
    second = fusion("second")
    assert second.exit_code(SOON_S) == FAILED
    assert f"another fusion node runs in this graph: '{bench.namespace}/fusion'" in second.printed()
    assert json.loads((tmp_path / "second" / "summary.json").read_text())["steps"] == 0
    assert first.popen.poll() is None


def test_fusion_does_not_begin_with_two_simulators(bench, tmp_path):
    fakes = [bench.add(FakeSimulator), bench.add(FakeSimulator)]
    for index in range(3):
        bench.add(FakeBehavior, index)
    commands = listen(bench.add(Partner), WheelCommand, WHEEL_COMMAND)
    node = bench.add(FusionNode, run_directory=str(tmp_path / "run"))
    bench.until(node.finished.done, "the end of the run")
    assert node.finished.result() == FAILED
    assert "more than one simulator runs in this graph" in bench.said()
    assert [fake.granted for fake in fakes] == [[], []]
    assert commands == []


def test_a_second_simulator_of_the_same_process_is_noticed(bench):
    first = bench.add(SimulatorNode)
    second = bench.add(SimulatorNode)
    bench.until(lambda: first.finished.done() or second.finished.done(), "the end of one of them")
    bench.until_said("another simulator runs in this graph")


def test_a_fusion_node_started_into_a_match_ends_and_the_match_goes_on(start, start_node, domain, tmp_path):
    run: Run = start(
        *("--controller", "subsumption", "--processes", "one", "--realtime", "1", "--episodes", "1"),
        *("--max-steps", "1800", "--seed", "3"),
        environment={"ROS_DOMAIN_ID": domain["ROS_DOMAIN_ID"]},
    )
    run.until(lambda: (run.out / "episodes.csv").exists() and "simulator: " in run.log("graph"), "the graph")
    others = [
        start_node("fbql_fusion", "fusion", "--ros-args", "-p", f"run_directory:={tmp_path}/second"),
        start_node("fbql_sim", "simulator"),
    ]
    assert [other.exit_code(SOON_S) for other in others] == [FAILED, FAILED]
    assert run.exit_code() == 0, run.stderr
