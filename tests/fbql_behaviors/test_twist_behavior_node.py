"""The node of a tree from a bag: it answers as the core does, and falls silent when what it senses is old."""

from time import monotonic, monotonic_ns

import pytest
import yaml
from fbql_behaviors.core.bag_patterns import Event, patterns_of_bags
from fbql_behaviors.core.bag_spec import recipe_of, spec_of
from fbql_behaviors.core.induction import InductionParameters, induce
from fbql_behaviors.core.tree import Tree
from fbql_behaviors.core.twist_behavior import TwistBehavior
from fbql_behaviors.shipped import shipped_trees
from fbql_behaviors.storage import save_tree
from fbql_behaviors.twist_behavior_node import TwistBehaviorNode
from fbql_common.core.errors import BadInput
from fbql_common.core.twist import StampedTwist, Twist
from fbql_common.qos import SYSTEM_QOS
from fbql_common.wire import MESSAGES, decode_stamped_twist, decode_twist
from hand_driven import Partner
from rclpy.qos import qos_profile_sensor_data
from robot_bags import SPEC, drive, teleoperated
from sensor_msgs.msg import LaserScan

TYPES = {"/scan": "sensor_msgs/msg/LaserScan", "/cmd_vel": "geometry_msgs/msg/Twist"}
NEAR_RIGHT, NEAR_LEFT, CLEAR = (0.5, 3.0), (3.0, 0.5), (3.0, 3.0)


def tree_of_the_rule(topic="/scan", max_age_s=0.3, **types) -> Tree:
    """The tree of the bags' rule, whose recipe names a topic."""
    content = yaml.safe_load(SPEC.replace("/scan", topic))
    spec = spec_of({**content, "max_age_s": max_age_s})
    events = []
    for name, _, time_ns, content in drive(1).messages:
        if name == "/scan":
            ranges = content.ranges
            events.append(Event(time_ns, topic, (float(ranges[:4].min()), float(ranges[8:].min()))))
        elif name == "/cmd_vel":
            events.append(Event(time_ns, name, (content.linear.x, content.angular.z)))
    patterns = patterns_of_bags(spec, [events]).patterns
    made = induce("keep_clear", patterns, InductionParameters(method="dp"), 1).tree
    recipe = recipe_of(spec, {topic: TYPES["/scan"], "/cmd_vel": TYPES["/cmd_vel"], **types})
    return Tree(made.behavior, made.features, made.nodes, made.leaves, made.origin, made.commands, recipe)


def scan_of(right_m, left_m):
    """A scan with something at these distances."""
    return LaserScan(ranges=[right_m] * 4 + [9.0] * 4 + [left_m] * 4)


class Driven:
    """The node and its partner, which publishes scans and hears the commands."""

    def __init__(self, bench, path, stamped=False, tree=None, **parameters):
        self.bench = bench
        topic = f"{bench.namespace}/scan"
        self.tree = tree or tree_of_the_rule(topic, 1.0)
        save_tree(path / "tree.json", self.tree)
        given = {"tree_file": str(path / "tree.json"), "rate_hz": 50.0, "stamped": stamped, **parameters}
        self.node = bench.add(TwistBehaviorNode, **given)
        self.partner = bench.add(Partner)
        self.out = []
        kind, decode = (StampedTwist, decode_stamped_twist) if stamped else (Twist, decode_twist)
        self.partner.create_subscription(
            MESSAGES[kind], "cmd_vel", lambda data: self.out.append(decode(data)), SYSTEM_QOS, raw=True
        )
        self.publisher = self.partner.create_publisher(LaserScan, topic, qos_profile_sensor_data)
        bench.until(lambda: self.publisher.get_subscription_count() == 1, "the node to subscribe the scan")
        bench.until(lambda: self.node.count_subscribers(f"{bench.namespace}/cmd_vel") == 1, "its commands to be heard")


def test_it_answers_as_the_core_and_the_rule_do(bench, tmp_path):
    driven = Driven(bench, tmp_path)
    core = TwistBehavior(driven.tree)
    (topic,) = core.types
    for place in (NEAR_RIGHT, CLEAR, NEAR_LEFT, (0.99, 0.5), (1.0, 1.0)):
        core.hear(topic, scan_of(*place), 0)
        expected = core.answer(0).twist
        linear, angular = teleoperated(*place)
        assert expected == Twist(linear_x_m_s=linear, angular_z_rad_s=angular)
        driven.publisher.publish(scan_of(*place))
        bench.until(lambda expected=expected: driven.out and driven.out[-1] == expected, f"the command at {place}")


def test_without_a_rate_it_answers_each_message_once(bench, tmp_path):
    driven = Driven(bench, tmp_path, rate_hz=0.0)
    for count, place in enumerate((NEAR_RIGHT, NEAR_RIGHT, NEAR_LEFT), start=1):
        driven.publisher.publish(scan_of(*place))
        bench.until(lambda count=count: len(driven.out) >= count, "a command")
        linear, angular = teleoperated(*place)
        assert driven.out[count - 1 :] == [Twist(linear_x_m_s=linear, angular_z_rad_s=angular)]


def test_a_stamped_command_has_time_and_frame(bench, tmp_path):
    driven = Driven(bench, tmp_path, stamped=True, frame="base")
    driven.publisher.publish(scan_of(*CLEAR))
    bench.until(lambda: driven.out, "a command")
    command = driven.out[0]
    assert (command.frame, command.twist) == ("base", Twist(linear_x_m_s=0.8))
    assert command.stamp_ns > 0


def test_it_is_silent_before_the_first_message_and_when_the_last_is_too_old(bench, tmp_path):
    driven = Driven(bench, tmp_path, tree=tree_of_the_rule(f"{bench.namespace}/scan", 0.5))
    bench.until_said("publishes no command: no message on")
    assert not driven.out
    began_s = monotonic()
    driven.publisher.publish(scan_of(*CLEAR))
    bench.until(lambda: driven.out, "a command")
    bench.until_said("older than 0.5 s")
    assert monotonic() - began_s > 0.5, "not before"
    count = len(driven.out)
    again_s = monotonic() + 0.3
    bench.until(lambda: monotonic() > again_s, "15 periods to pass")
    assert len(driven.out) == count
    driven.publisher.publish(scan_of(*NEAR_LEFT))
    bench.until(lambda: len(driven.out) > count, "commands again")


def test_a_message_that_lacks_what_the_recipe_reads_is_dropped_with_a_warning(bench, tmp_path):
    driven = Driven(bench, tmp_path)
    driven.publisher.publish(LaserScan(ranges=[1.0]))
    bench.until_said("dropped a message")
    assert "slice [0:4] is empty or out of range, the array has 1 elements" in bench.said()
    assert not driven.out


def test_a_soccer_tree_is_refused(bench):
    path = shipped_trees() / "ball_seeking.json"
    with pytest.raises(BadInput, match="the tree of 'ball_seeking' has no recipe of its observations"):
        bench.add(TwistBehaviorNode, tree_file=str(path))


def test_the_core_answers_nothing_without_a_message_and_says_when_it_clamps():
    core = TwistBehavior(tree_of_the_rule())
    now_ns = monotonic_ns()
    assert core.answer(now_ns).problem == "no message on /scan yet"
    core.hear("/scan", scan_of(8.0, 8.0), now_ns)
    answer = core.answer(now_ns + 10**8)
    assert (answer.twist, answer.clamped, core.clamped_count) == (Twist(linear_x_m_s=0.8), True, 1)
    core.hear("/scan", scan_of(float("nan"), 8.0), now_ns)
    assert core.answer(now_ns) == (None, -1, False, "right_distance not finite")
