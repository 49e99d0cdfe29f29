"""Converts domain types to bytes on the wire, and back; no other module does.

Every message of ours is published as bytes encoded here and received as bytes (`raw=True`) decoded here; the same bytes
are recorded. The layout is read from the generated message classes, so it cannot drift from the .msg files.
Encoding checks types (a wrong one raises TypeError before anything is published); decoding rejects messages that a node
must not act on, with the reason.
"""

from __future__ import annotations

from math import isfinite
from typing import Any

from builtin_interfaces.msg import Time
from fbql_msgs.msg import BehaviorOutput as BehaviorOutputMsg
from fbql_msgs.msg import FusionDecision as FusionDecisionMsg
from fbql_msgs.msg import MuxDecision as MuxDecisionMsg
from fbql_msgs.msg import Outcome as OutcomeMsg
from fbql_msgs.msg import WheelCommand as WheelCommandMsg
from fbql_msgs.msg import WorldState as WorldStateMsg
from geometry_msgs.msg import Twist as TwistMsg
from geometry_msgs.msg import TwistStamped, Vector3
from std_msgs.msg import Bool, Float64, Header

from fbql_common.core.cdr import Codec, Malformed
from fbql_common.core.mux_types import MuxDecision, RobotOutcome
from fbql_common.core.twist import StampedTwist, Twist
from fbql_common.core.types import FIELD_FRAME, BehaviorOutput, Decision, WheelCommand, World

NS = 1_000_000_000
MESSAGES = {
    BehaviorOutput: BehaviorOutputMsg,
    Decision: FusionDecisionMsg,
    WheelCommand: WheelCommandMsg,
    World: WorldStateMsg,
    Twist: TwistMsg,
    StampedTwist: TwistStamped,
    bool: Bool,
    float: Float64,
    MuxDecision: MuxDecisionMsg,
    RobotOutcome: OutcomeMsg,
}
"""The message that carries each domain type."""
_NESTED = {
    "std_msgs/Header": Header,
    "builtin_interfaces/Time": Time,
    "geometry_msgs/Twist": TwistMsg,
    "geometry_msgs/Vector3": Vector3,
}
_UNBOUNDED = {"double": "float64", "boolean": "bool", "octet": "uint8"}


class Rejected(ValueError):
    """A received message that must not be acted on; the text is the reason."""


def type_name(kind: type[Any]) -> str:
    """The message type of a domain type, as pkg/msg/Name."""
    message = MESSAGES[kind]
    return f"{message.__module__.split('.')[0]}/msg/{message.__name__}"


def _kinds(message: Any) -> list[str]:
    kinds: list[str] = []
    for kind in message.get_fields_and_field_types().values():
        if kind in _NESTED:
            kinds += _kinds(_NESTED[kind])
            continue
        element = kind.removeprefix("sequence<").removesuffix(">")
        kinds.append(kind.replace(element, _UNBOUNDED.get(element, element)))
    return kinds


_WORLD = Codec(_kinds(WorldStateMsg))
_OUTPUT = Codec(_kinds(BehaviorOutputMsg))
_COMMAND = Codec(_kinds(WheelCommandMsg))
_DECISION = Codec(_kinds(FusionDecisionMsg))
_TWIST = Codec(_kinds(TwistMsg))
_STAMPED_TWIST = Codec(_kinds(TwistStamped))
_FLAG = Codec(_kinds(Bool))
_NUMBER = Codec(_kinds(Float64))
_MUX_DECISION = Codec(_kinds(MuxDecisionMsg))
_OUTCOME = Codec(_kinds(OutcomeMsg))


def _header(stamp_ns: int) -> tuple[int, int, str]:
    return stamp_ns // NS, stamp_ns % NS, FIELD_FRAME


def _values(codec: Codec, data: bytes) -> list[Any]:
    try:
        return codec.decode(data)
    except Malformed as error:
        raise Rejected(f"malformed: {error}") from None


def _read(codec: Codec, data: bytes) -> tuple[int, list[Any]]:
    """The stamp [ns] and the fields after the header."""
    values = _values(codec, data)
    sec, nanosec, frame = values[0], values[1], values[2]
    if sec < 0 or nanosec >= NS:
        raise Rejected(f"the stamp ({sec} s, {nanosec} ns) is not a valid time")
    if frame != FIELD_FRAME:
        raise Rejected(f"frame_id is '{frame}', expected '{FIELD_FRAME}'")
    return sec * NS + nanosec, values[3:]  # pyright: ignore


def encode_world(world: World) -> bytes:
    """World -> CDR of fbql_msgs/WorldState. Raises TypeError."""
    return _WORLD.encode((*_header(world.stamp_ns), *world[1:]))


def decode_world(data: bytes) -> World:
    """CDR of fbql_msgs/WorldState -> World.

    Raises:
        Rejected: malformed, of another frame, or with a pose or velocity that is not finite.
    """
    stamp_ns, values = _read(_WORLD, data)
    world = World(stamp_ns, *values)
    if not isfinite(sum(world[3:15])):
        raise Rejected("a pose or velocity is not finite")
    return world


def encode_output(output: BehaviorOutput) -> bytes:
    """BehaviorOutput -> CDR of fbql_msgs/BehaviorOutput. Raises TypeError."""
    return _OUTPUT.encode((*_header(output.stamp_ns), *output[1:]))


def decode_output(data: bytes) -> BehaviorOutput:
    """CDR of fbql_msgs/BehaviorOutput -> BehaviorOutput.

    Raises:
        Rejected: malformed, of another frame, a reference that is not finite, or a leaf_id outside the tree.
    """
    stamp_ns, values = _read(_OUTPUT, data)
    output = BehaviorOutput(stamp_ns, *values)
    if not isfinite(output.left_rad_s + output.right_rad_s):
        raise Rejected("a reference is not finite")
    if not 0 <= output.leaf_id < output.leaf_count:
        raise Rejected(f"leaf_id {output.leaf_id} is outside of 0..{output.leaf_count - 1}")
    return output


def encode_command(command: WheelCommand) -> bytes:
    """WheelCommand -> CDR of fbql_msgs/WheelCommand. Raises TypeError."""
    return _COMMAND.encode((*_header(command.stamp_ns), *command[1:]))


def decode_command(data: bytes) -> WheelCommand:
    """CDR of fbql_msgs/WheelCommand -> WheelCommand.

    Raises:
        Rejected: malformed, of another frame, or a wheel velocity that is not finite.
    """
    stamp_ns, values = _read(_COMMAND, data)
    command = WheelCommand(stamp_ns, *values)
    if not isfinite(command.left_rad_s + command.right_rad_s):
        raise Rejected("a wheel velocity is not finite")
    return command


def encode_decision(decision: Decision) -> bytes:
    """Decision -> CDR of fbql_msgs/FusionDecision. Raises TypeError."""
    return _DECISION.encode((*_header(decision.stamp_ns), *decision[1:]))


def decode_decision(data: bytes) -> Decision:
    """CDR of fbql_msgs/FusionDecision -> Decision. Raises Rejected: malformed or of another frame."""
    stamp_ns, values = _read(_DECISION, data)
    return Decision(stamp_ns, *values)


def encode_twist(twist: Twist) -> bytes:
    """Twist -> CDR of geometry_msgs/Twist. Raises TypeError."""
    return _TWIST.encode(twist)


def decode_twist(data: bytes) -> Twist:
    """CDR of geometry_msgs/Twist -> Twist. Raises Rejected: malformed, or with a velocity that is not finite."""
    return _finite(_values(_TWIST, data))


def encode_stamped_twist(stamped: StampedTwist) -> bytes:
    """StampedTwist -> CDR of geometry_msgs/TwistStamped. Raises TypeError."""
    return _STAMPED_TWIST.encode((stamped.stamp_ns // NS, stamped.stamp_ns % NS, stamped.frame, *stamped.twist))


def decode_stamped_twist(data: bytes) -> StampedTwist:
    """CDR of geometry_msgs/TwistStamped -> StampedTwist.

    Raises:
        Rejected: malformed, or with a velocity that is not finite. Any stamp and frame will do.
    """
    sec, nanosec, frame, *velocities = _values(_STAMPED_TWIST, data)
    return StampedTwist(sec * NS + nanosec, frame, _finite(velocities))


def _finite(velocities: list[float]) -> Twist:
    if not all(map(isfinite, velocities)):
        raise Rejected("a velocity is not finite")
    return Twist(*velocities)


def encode_flag(flag: bool) -> bytes:
    """bool -> CDR of std_msgs/Bool. Raises TypeError."""
    return _FLAG.encode((flag,))


def decode_flag(data: bytes) -> bool:
    """CDR of std_msgs/Bool -> bool. Raises Rejected: malformed."""
    return _values(_FLAG, data)[0]


def encode_number(number: float) -> bytes:
    """float -> CDR of std_msgs/Float64. Raises TypeError."""
    return _NUMBER.encode((number,))


def decode_number(data: bytes) -> float:
    """CDR of std_msgs/Float64 -> float. Raises Rejected: malformed, or not finite."""
    number: float = _values(_NUMBER, data)[0]
    if not isfinite(number):
        raise Rejected("the number is not finite")
    return number


def encode_outcome(outcome: RobotOutcome) -> bytes:
    """RobotOutcome -> CDR of fbql_msgs/Outcome. Raises TypeError."""
    return _OUTCOME.encode((outcome.stamp_ns // NS, outcome.stamp_ns % NS, *outcome[1:]))


def decode_outcome(data: bytes) -> RobotOutcome:
    """CDR of fbql_msgs/Outcome -> RobotOutcome. Raises Rejected: malformed, or with a reward that is not finite."""
    sec, nanosec, *values = _values(_OUTCOME, data)
    outcome = RobotOutcome(sec * NS + nanosec, *values)
    if not isfinite(outcome.reward):
        raise Rejected("the reward is not finite")
    return outcome


def encode_mux_decision(decision: MuxDecision) -> bytes:
    """MuxDecision -> CDR of fbql_msgs/MuxDecision. Raises TypeError."""
    return _MUX_DECISION.encode((decision.stamp_ns // NS, decision.stamp_ns % NS, "", *decision[1:]))


def decode_mux_decision(data: bytes) -> MuxDecision:
    """CDR of fbql_msgs/MuxDecision -> MuxDecision. Raises Rejected: malformed."""
    sec, nanosec, _, *values = _values(_MUX_DECISION, data)
    return MuxDecision(sec * NS + nanosec, *values)
