"""What other machines can reach of a graph: nothing. Another machine is a network namespace at the end of a cable."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from collections.abc import Callable
from ipaddress import IPv4Address
from pathlib import Path

import pytest
from bringup_run import Run
from patience import PATIENCE_S
from places import ROOT

Start = Callable[..., Run]
LISTENER = ROOT / "tests" / "helpers" / "foreign_listener.py"
PLAY = ("--controller", "subsumption", "--seed", "3", "--processes", "one")
PLAIN_PROFILE = """<?xml version="1.0"?>
<profiles xmlns="http://www.eprosima.com/XMLSchemas/fastRTPS_Profiles">
  <participant profile_name="plain" is_default_profile="true"><rtps/></participant>
</profiles>
"""
TWO_HOSTS = """
set -e
ip link set lo up
unshare --net sleep 300 & other=$!
while [ "$(readlink /proc/$other/ns/net)" = "$(readlink /proc/self/ns/net)" ]; do sleep 0.02; done
ip link add here type veth peer name there
ip link set there netns $other
ip addr add 10.99.0.1/24 dev here && ip link set here up
over() { nsenter --target $other --net unshare --mount "$@"; }
over sh -c 'ip link set lo up; ip addr add 10.99.0.2/24 dev there; ip link set there up'
"""
"""A machine at 10.99.0.1, with a second one at 10.99.0.2, in which `over` runs a command with a /dev/shm of its own."""


def in_two_hosts(script: str) -> list[str]:
    """The command that runs another one on the first of two machines: `script`, then the command, then the end of both."""
    for tool in ("ip", "unshare", "nsenter"):
        if shutil.which(tool) is None:
            pytest.skip(f"two machines need the program {tool} (iproute2, util-linux)")
    space = ["unshare", "--user", "--map-root-user", "--net", "--mount", "--pid", "--fork", "--mount-proc", "sh", "-c"]
    tried = subprocess.run([*space, TWO_HOSTS], capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    if tried.returncode:
        pytest.skip(f"no network namespaces here: {tried.stderr}")
    return [*space, f'{TWO_HOSTS}\n{script}\nset +e\n"$@"\nexit $?', "sh"]


def seen_from_the_other_host(start: Start, place: Path, **environment: str) -> dict[str, object]:
    """What a listener on another machine, which names this one as its peer, sees of a match in real time."""
    out = place / "seen.json"
    listen = (
        "over sh -c 'mount -t tmpfs tmpfs /dev/shm && ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET ROS_STATIC_PEERS=10.99.0.1 "
        f"ROS_DOMAIN_ID=42 exec {sys.executable} {LISTENER} {out}' &\nuntil [ -e {out} ]; do sleep 0.05; done"
    )
    environment = {"ROS_DOMAIN_ID": "42", "ROS_LOG_DIR": str(place), **environment}
    match = (*PLAY, "--realtime", "1", "--episodes", "1", "--max-steps", "480")
    run = start(*match, before=in_two_hosts(listen), environment=environment)
    assert run.exit_code() == 0, run.stderr
    return json.loads(out.read_text())


def test_a_node_on_another_machine_that_names_this_one_as_its_peer_sees_nothing(start: Start, tmp_path: Path) -> None:
    assert seen_from_the_other_host(start, tmp_path) == {"nodes": [], "worlds": 0}


@pytest.mark.long
def test_the_other_machine_is_reached_by_a_user_who_asks_for_it(start: Start, tmp_path: Path) -> None:
    """The test above would see it: the same graph with a profile of the user's own."""
    profile = tmp_path / "plain.xml"
    profile.write_text(PLAIN_PROFILE)
    seen = seen_from_the_other_host(start, tmp_path, FASTRTPS_DEFAULT_PROFILES_FILE=str(profile))
    assert "fusion" in seen["nodes"]


def addresses(pid: int) -> set[str]:
    """The local addresses of the sockets of a process, those of IPv6 as they stand in its table."""
    links = {str(each.readlink()) for each in Path(f"/proc/{pid}/fd").iterdir()}
    inodes = {link.removeprefix("socket:[").removesuffix("]") for link in links if link.startswith("socket:")}
    found: set[str] = set()
    for table in ("udp", "udp6", "tcp", "tcp6"):
        for line in Path(f"/proc/{pid}/net/{table}").read_text().splitlines()[1:]:
            words = line.split()
            if words[9] in inodes:
                address = words[1].partition(":")[0]
                found.add(str(IPv4Address(bytes.fromhex(address)[::-1])) if len(address) == 8 else address)
    return found


def test_every_socket_of_a_graph_is_bound_to_loopback(start: Start) -> None:
    run = start(*PLAY, "--episodes", "100000")
    run.until_playing()
    pids = [pid for pid in run.processes() if addresses(pid)]
    assert len(pids) == 2, "the launcher and the process of all nodes"
    assert {address for pid in pids for address in addresses(pid)} == {"127.0.0.1"}
