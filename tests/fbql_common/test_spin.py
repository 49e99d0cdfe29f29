"""The executables as real processes: signals, exit codes, log directories, and processor time while idle."""

import json
import signal
from concurrent.futures import ThreadPoolExecutor
from time import monotonic

from fbql_common.core.topic_names import WORLD
from fbql_common.core.types import World
from fbql_common.spin import BAD_INPUT, DONE
from fbql_sim.core.world_loop import WorldLoop
from hand_driven import Partner, listen, shipped_tree

READY = {
    ("fbql_sim", "simulator"): "simulator: lockstep",
    ("fbql_behaviors", "ball_seeking"): "ball_seeking: ",
    ("fbql_behaviors", "wall_avoiding"): "wall_avoiding: ",
    ("fbql_behaviors", "approaching"): "approaching: ",
    ("fbql_fusion", "fusion"): "; run in ",
}
IDLE_SHARE = 0.1
"""Share of a core. A waiting node takes about 0.02; a busy loop takes 1."""


def start_all(start_node, *arguments, **environment):
    """Starts every executable, and waits until each runs."""
    nodes = [start_node(*executable, *arguments, **environment) for executable in READY]
    for node, ready in zip(nodes, READY.values(), strict=True):
        node.until_printed(ready)
    return nodes


def cpu_shares(nodes, duration_s=1.0):
    """The share of a core that each process takes, all measured at once."""
    with ThreadPoolExecutor(len(nodes)) as pool:
        return dict(
            zip([node.name for node in nodes], pool.map(lambda node: node.cpu_share(duration_s), nodes), strict=True)
        )


def test_nodes_that_wait_leave_the_processor_alone_and_signals_end_them_with_exit_code_0(start_node, bench):
    """SIGINT ends each executable; the other two take the same way, so one executable stands for all."""
    # Each in a namespace of its own: nobody finds anybody.
    nodes = []
    for number, executable in enumerate(READY):
        nodes.append(start_node(*executable, "--ros-args", "-r", f"__ns:={bench.namespace}/n{number}"))
    for node, ready in zip(nodes, READY.values(), strict=True):
        node.until_printed(ready)
    shares = cpu_shares(nodes)
    assert max(shares.values()) < IDLE_SHARE, shares
    others = {
        number: start_node("fbql_sim", "simulator", "--ros-args", "-r", f"__ns:=/{number.name}")
        for number in (signal.SIGTERM, signal.SIGHUP)
    }
    for node in others.values():
        node.until_printed("simulator: lockstep")
    sent_s = monotonic()
    for node in nodes:
        node.send(signal.SIGINT)
    for number, node in others.items():
        node.send(number)
    nodes += others.values()
    assert [node.exit_code() for node in nodes] == [DONE] * len(nodes)
    assert monotonic() - sent_s < 5
    assert not [node.name for node in nodes if "Traceback" in node.printed()]


def test_second_interrupt_does_not_cut_the_end_short(start_node, tmp_path):
    node = start_node("fbql_fusion", "fusion", "--ros-args", "-p", f"run_directory:={tmp_path}/run")
    node.until_printed("; run in ")
    node.send(signal.SIGINT)
    node.send(signal.SIGINT)
    node.send(signal.SIGTERM)
    assert node.exit_code() == DONE
    assert not json.loads((tmp_path / "run" / "summary.json").read_text())["incomplete"]
    assert (tmp_path / "run" / "metadata.yaml").exists()
    assert not list((tmp_path / "run").glob("*.active"))


def test_bad_input_is_one_line_and_exit_code_2(start_node, tmp_path):
    broken = tmp_path / "broken.yaml"
    broken.write_text("simulator: {ros__parameters: {seed: [}}")
    cases = {
        "/simulator: unknown parameter 'spede'": ("-p", "spede:=1.0"),
        "must be double, not integer 1; write 1.0": ("-p", "dt_s:=1"),
        "'use_sim_time'": ("-p", "use_sim_time:=5"),
        "unknown ROS arguments: ['--nonsense']": ("--nonsense",),
        "broken.yaml": ("--params-file", str(broken)),
        "absent.yaml: no such file": ("--params-file", str(tmp_path / "absent.yaml")),
        "Invalid topic name": ("-p", "name:=a b", "-p", "tree_file:={tree}"),
    }
    tree = str(shipped_tree("approaching"))
    nodes = [
        ("simulator: unknown arguments: -p seed:=7", start_node("fbql_sim", "simulator", "-p", "seed:=7")),
        ("fusion: unknown arguments: --halp", start_node("fbql_fusion", "fusion", "--halp")),
    ]
    for said, arguments in cases.items():
        executable = ("fbql_behaviors", "behavior") if "{tree}" in str(arguments) else ("fbql_sim", "simulator")
        ros = [argument.format(tree=tree) for argument in arguments]
        nodes.append((said, start_node(*executable, "--ros-args", *ros)))
    for said, node in nodes:
        assert node.exit_code() == BAD_INPUT, f"{said}: {node.printed()}"
        lines = node.printed().splitlines()
        assert said in lines[-1]
        assert len([line for line in lines if "[rcl]" not in line]) == 1, node.printed()


def test_security_that_this_middleware_lacks_is_refused(start_node):
    node = start_node("fbql_sim", "simulator", ROS_SECURITY_ENABLE="true")
    assert node.exit_code() == BAD_INPUT
    assert "would run unsecured" in node.printed() and len(node.printed().splitlines()) == 1


def test_log_directory_that_cannot_be_written_is_redirected(start_node, tmp_path):
    file = tmp_path / "a_file"
    file.touch()
    cases = {
        "a file is in the way": {"ROS_LOG_DIR": str(file / "log")},
        "home takes no files": {"ROS_LOG_DIR": "", "HOME": "/proc"},
        "no home": {"ROS_LOG_DIR": "", "HOME": ""},
    }
    nodes = {
        case: start_node(
            *("fbql_sim", "simulator", "--ros-args", "-r", f"__ns:=/case{number}"), TMPDIR=str(tmp_path), **environment
        )
        for number, (case, environment) in enumerate(cases.items())
    }
    for case, node in nodes.items():
        node.until_printed("simulator: lockstep")
        assert f"; using {tmp_path}/fbql-log-" in node.printed(), case
        node.send(signal.SIGINT)
        assert node.exit_code() == DONE
    logs = [path for path in tmp_path.glob("fbql-log-*/*") if path.stat().st_size]
    assert len(logs) == len(cases)


def test_namespace_remapping_and_parameter_file_apply(start_node, bench, tmp_path):
    namespace = f"{bench.namespace}/a"
    path = tmp_path / "parameters.yaml"
    path.write_text(f"{namespace}/field:\n  ros__parameters:\n    seed: 5\n    request_period_s: 0.05\n")
    remapped = ("-r", f"__ns:={namespace}", "-r", "__node:=field", "-r", "world:=other")
    start_node("fbql_sim", "simulator", "--ros-args", *remapped, "--params-file", str(path))
    partner = bench.add(Partner)
    worlds = listen(partner, World, "a/other")
    bench.until(lambda: len(worlds) > 1, "world states on the remapped topic", 20.0)
    assert worlds[0][1:] == WorldLoop().reset(-1, 5)[1:], "the seed of the parameter file was not used"
    bench.until(lambda: ("field", namespace) in partner.get_node_names_and_namespaces(), "the node's new name")
    bench.until(lambda: partner.count_publishers("a/robot/pose") == 1, "a topic in the namespace")
    assert partner.count_publishers("a/world") == 0


def test_graph_survives_a_killed_behavior_and_idles_without_its_simulator(start_node, bench, tmp_path):
    ros = ("--ros-args", "-r", f"__ns:={bench.namespace}")
    simulator, *behaviors, fusion = start_all(start_node, *ros)
    partner = bench.add(Partner)
    worlds = listen(partner, World, WORLD)
    bench.until(lambda: worlds and worlds[-1].step > 100, "a hundred steps", 30.0)

    behaviors[2].send(signal.SIGKILL)
    behaviors[2].exit_code()
    fusion.until_printed("approaching within 0.1 s: continuing without it")
    step = worlds[-1].step
    bench.until(lambda: worlds[-1].episode > 0 or worlds[-1].step > step + 50, "fifty steps more")

    simulator.send(signal.SIGKILL)
    simulator.exit_code()
    rest = [*behaviors[:2], fusion]
    for node in rest:
        node.until_printed("simulation paused: no world state")
    fusion.until_printed("no world state of the episode for 0.5 s: the wheels are stopped")
    shares = cpu_shares(rest)
    assert max(shares.values()) < IDLE_SHARE, shares

    episode = worlds[-1].episode
    del worlds[:]
    start_node("fbql_sim", "simulator", *ros)
    fusion.until_printed(f"episode {episode} is lost and begins again")
    bench.until(lambda: worlds and worlds[-1].episode >= episode and worlds[-1].step > 50, "fifty steps", 30.0)

    for node in rest:
        node.send(signal.SIGINT)
    assert [node.exit_code() for node in rest] == [DONE] * 3
    assert not [node.name for node in rest if "Traceback" in node.printed()]
    (run,) = (tmp_path / "runs").iterdir()
    assert (run / "metadata.yaml").exists() and not list(run.glob("*.active"))


def test_simulator_stops_the_wheels_when_fusion_is_killed(start_node, bench):
    """Fault 25: in real time the field goes on, and the robot stands."""
    nodes = {}
    for executable in READY:
        own = ("-p", "realtime:=1.0") if executable[1] == "simulator" else ()
        nodes[executable[1]] = start_node(*executable, "--ros-args", "-r", f"__ns:={bench.namespace}", *own)
    worlds = listen(bench.add(Partner), World, WORLD)

    def drives():
        """In whichever episode: on a busy machine the first one may pass with hardly a command in time."""
        world = worlds[-1] if worlds else None
        # The ball is far from the goals, so that the robot can come to rest before one ends the episode.
        return world and not world.ended and world.robot_speed_m_s > 0.2 and abs(world.ball_x_m) < 0.8

    bench.until(drives, "the robot to drive", 60.0)

    nodes["fusion"].send(signal.SIGKILL)
    nodes["fusion"].exit_code()
    bench.until(lambda: abs(worlds[-1].robot_speed_m_s) < 0.01, "the robot to stand", 5.0)
    nodes["simulator"].until_printed("no command for 0.25 s: the wheels are stopped")
    step = worlds[-1].step
    # The ball may roll on into a goal, and nobody is left to ask for another episode.
    bench.until(lambda: worlds[-1].step > step + 20 or worlds[-1].ended, "twenty steps more, or the end")
    assert abs(worlds[-1].robot_speed_m_s) < 0.01
