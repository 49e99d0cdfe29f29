"""`--watch browser`: the report's page while the match is played, in a real browser that sets its pace and changes none of it."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from bringup_run import Run
from browser import Browser, browser_path
from commands import demonstrate
from recorded_match import record_match
from run_directory_reader import summary_of
from websockets.sync.client import connect

Start = Callable[..., Run]
BROWSER = browser_path()
needs_browser = pytest.mark.skipif(BROWSER is None, reason="no Chromium or Chrome on this machine")
READY = "!document.getElementById('player').hasAttribute('aria-busy')"
NO_SCREEN = dict.fromkeys(("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"))


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    assert BROWSER is not None
    with Browser(BROWSER, tmp_path / "profile") as made:
        yield made


def address_of(run: Run) -> str:
    """The address that the command prints."""
    run.until(lambda: re.search(r"http://127\.0\.0\.1:\d+/", run.stderr), "the address is printed")
    found = re.search(r"http://127\.0\.0\.1:\d+/", run.stderr)
    assert found is not None
    return found[0]


def opened(browser: Browser, run: Run) -> str:
    address = address_of(run)
    browser.open(address)
    browser.wait_for(READY, "the first step")
    return address


def text(browser: Browser, selector: str) -> str:
    return browser.evaluate(f"document.querySelector({selector!r}).textContent")


def shown(browser: Browser, pattern: str, selector: str) -> None:
    browser.wait_for(lambda: re.search(pattern, text(browser, selector)), f"{selector} shows '{pattern}'")


def settled(browser: Browser, selector: str) -> str:
    """A text that changes no more: what was under way has been drawn."""
    texts = [""]

    def same() -> bool:
        texts.append(text(browser, selector))
        browser.evaluate("new Promise((done) => setTimeout(done, 300))")
        return texts[-1] == texts[-2]

    browser.wait_for(same, f"{selector} to stand still")
    return texts[-1]


def fastest(browser: Browser) -> None:
    browser.evaluate(
        "(() => { const e = document.getElementById('speed'); e.value = 0; e.dispatchEvent(new Event('change')); })()"
    )


@needs_browser
def test_a_watched_match_is_the_match_bit_for_bit_and_the_page_sets_its_pace(
    start: Start, browser: Browser, tmp_path: Path
) -> None:
    match = ("--goals", "2", "--seed", "0", "--json")
    alone = start(*match, "--out", str(tmp_path / "alone"), script="train.py", out=False)
    assert alone.exit_code() == 0, alone.stderr
    run = start(*match, "--processes", "one", "--watch", "browser", environment=NO_SCREEN)
    address = opened(browser, run)
    shown(browser, r"step \d\d", "#when")
    assert "drives alone" in text(browser, "#why")
    browser.key(" ")
    shown(browser, "paused", "#live")
    browser.wait_for("document.getElementById('play').textContent.includes('Play')", "the button to go on")
    before = settled(browser, "#when")
    browser.click("#forth")
    browser.wait_for(lambda: text(browser, "#when") != before, "one step more")
    browser.click("#back")
    shown(browser, re.escape(before), "#when")
    shown(browser, "Live", "#play")
    browser.click("#play")
    shown(browser, "Play", "#play")
    browser.click("#next-episode")
    shown(browser, "episode 1 ", "#when")
    browser.click("#play")
    shown(browser, "Live: 1 x real time", "#live")
    fastest(browser)
    assert run.exit_code() == 0, run.stderr
    assert json.loads(run.stdout) == summary_of(run.out)
    assert summary_of(run.out)["digest"] == json.loads(alone.stdout)["digest"]
    shown(browser, "has ended", "#live")
    shown(browser, "2 goals", ".tiles")
    shown(browser, r"episode \(2\)", "#jumps")
    browser.click("#previous-episode")
    shown(browser, "step 0 of", "#when")
    browser.click("#play")
    shown(browser, r"step \d\d of", "#when")
    assert browser.complaints == []
    assert set(browser.requests) == {address}


@needs_browser
@pytest.mark.parametrize("width", [360, 1280])
def test_a_page_that_is_opened_late_or_again_has_all_of_it(start: Start, browser: Browser, width: int) -> None:
    run = start("--goals", "1", "--processes", "one", "--watch", "browser", environment=NO_SCREEN)
    browser.resize(width, 800)
    opened(browser, run)
    shown(browser, r"step \d\d", "#when")
    browser.key(" ")
    shown(browser, "paused", "#live")
    before = settled(browser, "#scrub-words")
    opened(browser, run)
    shown(browser, re.escape(before), "#scrub-words")
    assert browser.evaluate("document.documentElement.scrollWidth <= innerWidth")
    browser.open("about:blank")  # whoever paused it is gone: it goes on
    assert run.exit_code() == 0, run.stderr


def test_whoever_never_opens_the_page_gets_the_result(start: Start) -> None:
    run = start("--goals", "1", "--processes", "one", "--realtime", "20", "--watch", "browser", environment=NO_SCREEN)
    address_of(run)
    assert run.exit_code() == 0, run.stderr
    assert "watch it: open this in a browser" in run.stderr


def test_where_there_is_a_screen_the_page_is_opened(start: Start, tmp_path: Path) -> None:
    program = tmp_path / "browser"
    program.write_text(f'#!/bin/sh\necho noise\necho "$1" > {tmp_path}/opened\n')
    program.chmod(0o755)
    run = start(
        *("--goals", "1", "--processes", "one", "--realtime", "20", "--watch", "browser", "--json"),
        environment={**NO_SCREEN, "BROWSER": f"{program} %s"},
    )
    run.until(lambda: (tmp_path / "opened").exists(), "the browser is opened")
    assert run.exit_code() == 0, run.stderr
    assert (tmp_path / "opened").read_text().strip() == address_of(run)
    json.loads(run.stdout)


@needs_browser
def test_a_replay_is_watched(start: Start, browser: Browser, tmp_path: Path) -> None:
    made = record_match(tmp_path / "made", episodes=2, max_steps=200)
    run = start(str(made), "--watch", "browser", "--json", script="replay.py", out=False, environment=NO_SCREEN)
    opened(browser, run)
    shown(browser, r"step \d\d", "#when")
    assert text(browser, "h1") == "made"
    browser.click("#next-episode")
    shown(browser, "episode 1 ", "#when")
    assert "its rule there" in text(browser, "#why")
    fastest(browser)
    assert run.exit_code() == 0, run.stderr
    assert json.loads(run.stdout)["complete"] is True
    shown(browser, "2 episodes", ".tiles")


@needs_browser
def test_demonstrations_are_watched(start: Start, browser: Browser, tmp_path: Path) -> None:
    made = tmp_path / "made"
    assert demonstrate(["wall_avoiding", "--demonstrations", "3", "--steps", "60", "--out", str(made)]) == 0
    made = made.rename(tmp_path / "kept")
    run = start(
        "--replay", str(made), "--watch", "browser", "--json", script="demonstrate.py", out=False, environment=NO_SCREEN
    )
    opened(browser, run)
    shown(browser, "The instructor demonstrates wall_avoiding", "#why")
    assert text(browser, "h1") == "kept"
    fastest(browser)
    assert run.exit_code() == 0, run.stderr
    assert json.loads(run.stdout)["identical"] is True
    shown(browser, r"episode \(3\)", "#jumps")
    assert browser.complaints == []


def test_a_page_that_leaves_while_it_is_paused_holds_up_nothing(start: Start) -> None:
    run = start("--goals", "1", "--processes", "one", "--watch", "browser", environment=NO_SCREEN)
    with connect(f"ws{address_of(run).removeprefix('http')}live") as page:
        page.send("pause")
        run.until(lambda: '"paused": true' in page.recv(60.0), "it is paused")
    assert run.exit_code() == 0, run.stderr


def test_a_match_that_nobody_watches_loads_nothing_of_it() -> None:
    program = (
        "import sys; from fbql.commands import bringup, demonstrate, replay; from fbql.replay import republish; "
        "print([name for name in sys.modules if name.startswith(('websockets', 'asyncio', 'fbql.watch.browser', 'fbql.watch.server'))])"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=120, check=True)
    assert done.stdout == "[]\n"
