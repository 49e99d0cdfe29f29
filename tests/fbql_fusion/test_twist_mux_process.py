"""The mux as a real process, with real timers: its output is that of the rules, and dies with its sources."""

import os
import re
import signal
import subprocess
import sys
from itertools import cycle
from time import monotonic

import numpy as np
import pytest
from fbql_common.core.twist import Twist
from fbql_common.spin import BAD_INPUT
from fbql_fusion.core.mux.config import Lock, Source
from mux_bench import TWO_SOURCES, Sources
from mux_oracle import Event, passed_on
from places import ROOT
from twist_source import OWN_MARK

SOURCE_PROCESS = ROOT / "tests" / "helpers" / "twist_source.py"
SOURCES = (
    Source("alpha", "alpha_vel", 0.25, 50),
    Source("beta", "beta_vel", 0.4, 50),
    Source("gamma", "gamma_vel", 0.15, 200),
    Source("omega", "omega_vel", 0.0, 7),
)
LOCKS = (Lock("beat", "beat", 0.5, 40), Lock("stop", "stop", 0.0, 100))
LOST_S = 1.0
"""A message that was not received after this time is lost [s]."""
HEARD = re.compile(
    r"(\w+): (passed on|not passed on|on|off), received at (\d+), read at (\d+)(?:, (\S+) m/s)?$", re.MULTILINE
)


def file_of(sources, locks=()):
    """The parameters of a mux as text."""
    lines = ["/**/twist_mux:", "  ros__parameters:"]
    for kind, entries in (("topics", sources), ("locks", locks)):
        for entry in entries:
            fields = f"topic: {entry.topic}, timeout: {entry.timeout_s}, priority: {entry.priority}"
            lines.append(f"    {kind}.{entry.name}: {{{fields}}}")
    return "\n".join(lines)


@pytest.fixture
def mux(bench, start_node, tmp_path):
    """Starts a mux with a file of these parameters; gives its process, and its sources as a node of the test."""

    def begin(text, *arguments):
        file = tmp_path / "twist_mux.yaml"
        file.write_text(text)
        process = start_node(
            *("fbql_fusion", "twist_mux", "--ros-args", "--params-file", str(file)),
            *("-r", f"__ns:={bench.namespace}", *arguments),
        )
        process.until_printed("Twist on")
        sources = Sources(bench)
        bench.until(lambda: sources.drivers, "the mux to be heard")
        return process, sources

    return begin


def play(seed, bench, process, sources, messages):
    """Sends messages of sources and locks at random times. Returns the events as the mux received them."""
    generator = np.random.default_rng(seed)
    names = [*(source.name for source in SOURCES), *(lock.name for lock in LOCKS)]
    shares = generator.dirichlet(np.ones(len(names)))
    heard = 0
    for number in range(messages):
        place = int(generator.choice(len(names), p=shares))
        if place < len(SOURCES):
            sources.send(SOURCES[place].topic, Twist(float(number)))
        else:
            sources.lock(LOCKS[place - len(SOURCES)].topic, bool(generator.random() < 0.3))
        # The next one only when this one is received, because an input keeps one message; or lost, which it may be, because
        # the middleware's default for an input is best effort.
        before, lost_s = heard, monotonic() + LOST_S
        while heard == before and monotonic() < lost_s:
            bench.spin()
            heard = len(HEARD.findall(process.printed()))
        pause_s = monotonic() + float(generator.choice([0.0, 0.02, 0.06, 0.12, 0.2]))
        bench.until(lambda until=pause_s: monotonic() >= until, "the next message to be due")
    assert heard >= 0.8 * messages
    return HEARD.findall(process.printed())


def check_schedule(seed, mux, bench, messages):
    """Compares the output with the rules applied to what was received."""
    process, sources = mux(file_of(SOURCES, LOCKS), "--log-level", f"{bench.namespace[1:]}.twist_mux:=debug")
    heard = play(seed, bench, process, sources, messages)
    events = [
        Event(int(read_ns), name, None if what.endswith("passed on") else what == "on", int(at_ns))
        for name, what, at_ns, read_ns, _ in heard
    ]
    expected = passed_on(SOURCES, LOCKS, events)
    bench.until(lambda: len(sources.out) >= len(expected), "the output")
    assert [command.linear_x_m_s for command in sources.out] == [float(heard[place][4]) for place in expected]
    assert [place for place, (_, what, *_) in enumerate(heard) if what == "passed on"] == expected
    return len(expected), len([event for event in events if event.on is None])


def test_output_of_a_real_schedule_is_that_of_the_rules(mux, bench):
    passed, commands = check_schedule(3, mux, bench, 60)
    assert 5 < passed < commands - 5, "both outcomes are common"


@pytest.mark.long
@pytest.mark.parametrize("seed", range(20))
def test_output_of_more_real_schedules_is_that_of_the_rules(mux, bench, seed):
    check_schedule(100 + seed, mux, bench, 100)


TIMEOUT_S = 1.0
VICTIM, FALLBACK = Source("victim", "victim_vel", TIMEOUT_S, 20), Source("fallback", "fallback_vel", TIMEOUT_S, 10)
PASSED_LATER = re.compile(r"(\w+): last command passed on at (\d+)$")


LEARNING = "\n".join(
    ["", "    learn: true", "    controller: priorities", "    hold_s: 0.0", "    decision_period_s: 0.05"]
)
"""Of a mux that decides at ticks, by the priorities."""


def ages_passed_on_ns(printed):
    """The ages of the commands that were passed on when they were read, and of those that were passed on later [ns]."""
    received_ns, at_once_ns, later_ns = {}, [], []
    for line in printed.splitlines():
        if heard := HEARD.search(line):
            received_ns[heard[1]] = int(heard[3])
            if heard[2] == "passed on":
                at_once_ns.append(int(heard[4]) - int(heard[3]))
        elif later := PASSED_LATER.search(line):
            later_ns.append(int(later[2]) - received_ns[later[1]])
    return at_once_ns, later_ns


def end_sources(mux, bench, domain, how, more=""):
    """Ends a source's process again and again, as `how` says, while another one of a lower priority goes on.

    Ages are those by the mux's own clock, from when the middleware received a command to passing it on: on a machine with other load,
    the time from sending it to seeing it here says more about the load.
    """
    process, sources = mux(file_of((VICTIM, FALLBACK)) + more, "--log-level", f"{bench.namespace[1:]}.twist_mux:=debug")
    commands = 0

    def fall_back():
        nonlocal commands
        sources.send(FALLBACK.topic, Twist(monotonic()))
        bench.spin()
        out = list(sources.out)
        sources.out.clear()
        commands += len(out)
        return [command.linear_y_m_s == OWN_MARK for command in out]

    for number in how:
        command = [
            sys.executable,
            str(SOURCE_PROCESS),
            VICTIM.topic,
            "0.02",
            "--ros-args",
            "-r",
            f"__ns:={bench.namespace}",
        ]
        victim = subprocess.Popen(command, env={**os.environ, **domain}, stdout=subprocess.DEVNULL)
        try:
            bench.until(lambda: True in fall_back(), "the source to drive")
            victim.send_signal(number)
            ended_s = monotonic()
            bench.until(lambda: False in fall_back()[-1:], "the other one to drive")
            assert monotonic() - ended_s > TIMEOUT_S / 2, "not before the timeout"
        finally:
            victim.kill()
            victim.wait()
    assert commands > 10 * len(how)
    printed = process.printed()
    at_once_ns, later_ns = ages_passed_on_ns(printed)
    assert len(at_once_ns) + len(later_ns) >= commands
    assert max(at_once_ns + later_ns) <= TIMEOUT_S * 1e9
    return later_ns


def test_no_command_of_a_source_that_was_killed_or_hangs_is_passed_on_after_its_timeout(mux, bench, domain):
    end_sources(mux, bench, domain, [signal.SIGKILL, signal.SIGSTOP])


def test_nor_is_one_where_it_is_learned_whom_to_follow(mux, bench, domain, tmp_path):
    run = f"\n    run_directory: {tmp_path / 'run'}"
    assert end_sources(mux, bench, domain, [signal.SIGKILL, signal.SIGSTOP], LEARNING + run)


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_no_command_of_fifty_sources_that_were_killed_or_hang_is_passed_on_after_its_timeout(mux, bench, domain):
    signals = cycle([signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM])
    end_sources(mux, bench, domain, [next(signals) for _ in range(50)])


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_nor_of_fifty_where_it_is_learned_whom_to_follow(mux, bench, domain, tmp_path):
    signals = cycle([signal.SIGKILL, signal.SIGSTOP, signal.SIGTERM])
    run = f"\n    run_directory: {tmp_path / 'run'}"
    end_sources(mux, bench, domain, [next(signals) for _ in range(50)], LEARNING + run)


def test_a_bad_file_ends_the_mux_with_one_line(start_node, tmp_path):
    file = tmp_path / "twist_mux.yaml"
    file.write_text(TWO_SOURCES.replace("timeout : 0.5", "timeout : 1"))
    process = start_node("fbql_fusion", "twist_mux", "--ros-args", "--params-file", str(file))
    assert process.exit_code() == BAD_INPUT
    assert process.printed().splitlines() == [
        "/twist_mux: parameter 'topics.joystick.timeout' must be double, not integer 1; write 1.0"
    ]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_mux_ends_with_exit_code_0_when_it_is_asked_to(mux, number):
    process, _ = mux(TWO_SOURCES)
    process.send(number)
    assert process.exit_code() == 0
