"""Settings of the middleware for the processes of one machine: what it reads from the environment when it starts.

A graph of this project stays on its machine. Discovery alone does not see to that: Fast DDS binds its sockets to every
interface, and a participant elsewhere that names this machine as a peer is answered. So processes get our own profile,
which binds every socket to 127.0.0.1, and variables that would make discovery look elsewhere are set aside.
"""

from __future__ import annotations

import errno
import os
import re
import socket
import tempfile
from collections.abc import Callable
from pathlib import Path
from threading import Thread
from time import monotonic, sleep

from ament_index_python import get_resources

from fbql_common.core.errors import BadInput
from fbql_common.files import is_locked

SEARCH_S = 5.0
"""How long a host may be looked for [s]."""
MAKING_S = 1.0
"""How long a ROS program that starts may hold the lock of a port of shared memory before the port is there [s]."""
RANGE = "ROS_AUTOMATIC_DISCOVERY_RANGE"
PROFILES = ("FASTRTPS_DEFAULT_PROFILES_FILE", "FASTDDS_DEFAULT_PROFILES_FILE")
"""Variables that name a Fast DDS profile file; which one is read depends on its version."""
ELSEWHERE = {
    "ROS_DISCOVERY_SERVER": "nodes would be looked for at a discovery server",
    "ROS_SUPER_CLIENT": "it is for a discovery server",
    "ROS_STATIC_PEERS": "nodes would be looked for on other machines",
    "FASTDDS_ENVIRONMENT_FILE": "it may name a discovery server",
    "FASTDDS_BUILTIN_TRANSPORTS": "its sockets would be bound to every interface",
}
"""Variables that are set aside where a graph stays on this machine, and why."""
_RMW, _FAST_DDS = "RMW_IMPLEMENTATION", "rmw_fastrtps_cpp"
_SKIP_OTHER_PROFILES = "SKIP_DEFAULT_XML_FILE"
_LOCATOR = re.compile(r"(?:(?:TCP|UDP)v[46]:)?(?:\[(?P<six>[^]]+)\]|(?P<host>[^\[\]:]*))(?::\d+)?")
"""A host and perhaps a port, as ROS_STATIC_PEERS and ROS_DISCOVERY_SERVER name it."""
_SHARED_MEMORY = Path("/dev/shm")
_ROOM_BYTES = 8 << 20
"""Twice the room that a graph of five processes and a tool needs."""


def prepare_middleware(say: Callable[[str], None]) -> None:
    """Keeps the ROS nodes of this process, and of those it starts, on this machine. Call it before rclpy.init.

    Args:
        say: called with one line for each variable that is set aside, and for what else the user should know.

    Raises:
        BadInput: DDS-Security is requested.
    """
    refuse_security()
    set_aside_absent_middleware(say)
    if os.environ.pop("ROS_LOCALHOST_ONLY", "") not in ("", "0"):
        say(
            f"ROS_LOCALHOST_ONLY is set aside: it is deprecated, and the graph stays on this machine in any case ({RANGE})"
        )
    for name, reason in ELSEWHERE.items():
        if value := os.environ.pop(name, ""):
            say(f"{name}={value!r} is set aside, because this graph stays on this machine: {reason}")
    os.environ[RANGE] = "LOCALHOST"
    rmw = os.environ.get(_RMW, _FAST_DDS)
    if rmw != _FAST_DDS:
        say(
            f"{_RMW} is {rmw!r}: discovery stays on this machine, but what else can be reached is up to its own settings"
        )
    elif not _has_own_profile(say):
        problem = shared_memory_problem()
        if problem:
            say(f"{problem}; messages go over UDP instead, which changes no result")
        profile = str(Path(__file__).parent / "profiles" / ("loopback_udp.xml" if problem else "loopback.xml"))
        # With a range other than this one, rmw adds a transport of its own, which is bound to every interface.
        os.environ.update({**dict.fromkeys(PROFILES, profile), RANGE: "SYSTEM_DEFAULT", _SKIP_OTHER_PROFILES: "1"})


def prepare_node(say: Callable[[str], None]) -> None:
    """As `prepare_middleware`, for a node started by hand, whose user chooses the range of discovery: only if that is
    this machine. Raises BadInput if DDS-Security is requested, or a host that discovery needs can't be found."""
    refuse_security()
    local = os.environ.get(RANGE, "").upper() == "LOCALHOST" or os.environ.get("ROS_LOCALHOST_ONLY", "") not in (
        "",
        "0",
    )
    if local:
        prepare_middleware(say)
        return
    _refuse_unknown_hosts()
    if server := os.environ.get("ROS_DISCOVERY_SERVER"):
        say(f"ROS_DISCOVERY_SERVER={server!r} is in force: nodes find each other through that server alone")


def refuse_security() -> None:
    """Raises BadInput where DDS-Security is requested: it is not available here, and would be ignored silently."""
    if os.environ.get("ROS_SECURITY_ENABLE", "").lower() == "true":
        raise BadInput(
            "ROS_SECURITY_ENABLE is true, but this Fast DDS is built without DDS-Security and would run unsecured; "
            "unset it, or use a ROS 2 with SROS2"
        )


def shared_memory_problem(directory: Path = _SHARED_MEMORY) -> str:
    """What keeps Fast DDS from using shared memory, and how to repair it, in one line; empty if nothing does."""
    mend = f"when no ROS program runs: rm -f {directory}/fastrtps_* {directory}/sem.fastrtps_*"
    try:
        with tempfile.NamedTemporaryFile(prefix="fbql_", dir=directory) as file:
            os.posix_fallocate(file.fileno(), 0, os.sysconf("SC_PAGE_SIZE"))
        status = os.statvfs(directory)
    except OSError as error:
        return f"shared memory can't be used: {directory}: {error.strerror}; {mend}"
    if (room := status.f_bavail * status.f_frsize) < _ROOM_BYTES:
        return f"shared memory can't be used: {directory} has {room / 2**20:.1f} MB free, {_ROOM_BYTES >> 20} are needed; {mend}"
    foreign = [path.name for path in directory.glob("fastrtps_port*") if _is_denied(path)]
    if foreign:
        return f"shared memory can't be used: {directory}/{foreign[0]} belongs to another user; {mend}"
    locked = next((path.name for path in sorted(directory.glob("fastrtps_port*_el")) if _stays_locked(path)), "")
    if locked:
        return f"shared memory can't be used: {directory}/{locked} is locked, and not by a ROS program; {mend}"
    return ""


def _stays_locked(path: Path) -> bool:
    """Whether the lock file of a port is held without a port for longer than a ROS program takes to make one."""
    deadline = monotonic() + MAKING_S
    while _is_stale_lock(path):
        if monotonic() > deadline:
            return True
        sleep(0.05)
    return False


def _is_stale_lock(path: Path) -> bool:
    """Whether the lock file of a port is held although the port is not there, or is no port: Fast DDS would wait for it."""
    port = path.with_name(path.name.removesuffix("_el"))
    try:
        is_port = port.exists() and port.stat().st_size >= os.sysconf("SC_PAGE_SIZE")
        return not is_port and is_locked(path)
    except OSError:
        return False


def _is_denied(path: Path) -> bool:
    return path.exists() and not os.access(path, os.R_OK | os.W_OK)


def _has_own_profile(say: Callable[[str], None]) -> bool:
    """Whether the user names a profile file of their own; one that can't be read is set aside."""
    found = False
    for name in PROFILES:
        value = os.environ.get(name, "")
        if not value or Path(value).parent == Path(__file__).parent / "profiles":
            continue
        try:
            Path(value).read_bytes()
        except OSError as error:
            del os.environ[name]
            say(f"{name}={value!r} is set aside: the file can't be read ({error.strerror})")
            continue
        found = True
        say(f"{name}={value!r} is used instead of our profile: what other machines can reach is up to that file")
    return found


def set_aside_absent_middleware(say: Callable[[str], None]) -> None:
    """Sets RMW_IMPLEMENTATION aside where it names none that is installed: importing rclpy would end the process."""
    if problem := absent_middleware():
        del os.environ[_RMW]
        say(f"{problem}: it is set aside")


def absent_middleware() -> str:
    """The problem with RMW_IMPLEMENTATION, in one line; empty if it is unset or names an installed middleware."""
    name = os.environ.get(_RMW, "")
    try:
        known = sorted(each for each in get_resources("rmw_typesupport") if each != "rmw_implementation")
    except OSError:  # no ROS is sourced: what imports rclpy next says so
        return ""
    if not name or not known or name in known:
        return ""
    return f"{_RMW}={name!r} is not installed (installed: {', '.join(known)})"


def _refuse_unknown_hosts() -> None:
    """Raises BadInput where a variable names hosts for discovery that can't be found."""
    for name in ("ROS_STATIC_PEERS", "ROS_DISCOVERY_SERVER"):
        for entry in os.environ.get(name, "").split(";"):
            located = _LOCATOR.fullmatch(entry.strip())
            try:
                if located is None:
                    raise UnicodeError("not HOST or HOST:PORT")
                if located["host"]:
                    _find(located["host"])
            except (OSError, UnicodeError) as error:
                reason = error.strerror if isinstance(error, OSError) else error
                raise BadInput(f"{name}: {entry!r} can't be found ({reason}); correct it, or unset {name}") from None


def _find(host: str) -> None:
    """Raises OSError or UnicodeError if a host can't be found. A name server that does not answer must not keep us from starting."""
    failures: list[OSError | UnicodeError] = []

    def look() -> None:
        try:
            socket.getaddrinfo(host, None)
        except (OSError, UnicodeError) as error:
            failures.append(error)

    search = Thread(target=look, daemon=True)
    search.start()
    search.join(SEARCH_S)
    if search.is_alive():
        raise TimeoutError(errno.ETIMEDOUT, f"no answer within {SEARCH_S:g} s")
    for failure in failures:
        raise failure
