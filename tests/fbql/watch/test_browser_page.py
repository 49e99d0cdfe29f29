"""The live page in a real browser, told by hand what a match tells it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from browser import Browser, browser_path
from fbql.watch import feed
from fbql.watch.browser import BrowserPage
from fbql.watch.pace import Pace
from fbql_behaviors.storage import load_tree
from fbql_common.terminal.keys import Key
from fbql_recording.run import Run, open_run
from recorded_match import TREES, record_match

BROWSER = browser_path()
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium or Chrome on this machine")
READY = "!document.getElementById('player').hasAttribute('aria-busy')"


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Run:
    return open_run(record_match(tmp_path_factory.mktemp("run") / "run", episodes=5, max_steps=120))


@pytest.fixture
def browser(tmp_path: Path) -> Iterator[Browser]:
    assert BROWSER is not None
    with Browser(BROWSER, tmp_path / "profile") as made:
        yield made


@pytest.fixture
def page(run: Run, monkeypatch: pytest.MonkeyPatch) -> Iterator[BrowserPage]:
    for name in ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(feed, "KEPT_STEPS", 150)
    monkeypatch.setattr(feed, "_ARCHIVED", 25)
    trees = [load_tree(TREES / f"{name}.json") for name in run.behaviors]
    with BrowserPage(run.recorded, trees, "<b>a match</b>", "told by hand", lambda _: None, ["fbql"]) as made:
        made.pace = Pace(1.0, lambda: 0.0)
        yield made


def text(browser: Browser, selector: str) -> str:
    return browser.evaluate(f"document.querySelector({selector!r}).textContent")


def until_shown(browser: Browser, page: BrowserPage, words: str, selector: str = "#when") -> None:
    def is_shown() -> bool:
        page.keys()
        page.draw()
        return words in text(browser, selector)

    browser.wait_for(is_shown, f"{selector} shows '{words}'")


def test_what_is_older_than_it_keeps_is_forgotten_and_the_rest_is_right(
    run: Run, page: BrowserPage, browser: Browser
) -> None:
    columns = run.arrays()
    messages = list(run.messages())
    for message in messages[:400]:
        page.hear(message.topic, message.data)
    browser.open(page.address)
    browser.wait_for(lambda: [*page.keys()] or page.draw() or browser.evaluate(READY), "the first step")
    for begin in range(400, len(messages), 100):
        for message in messages[begin : begin + 100]:
            page.hear(message.topic, message.data)
        page.keys()
        page.draw()
    last = len(columns["step"]) - 1
    x, y = columns["robot_x_m"][last], columns["robot_y_m"][last]
    until_shown(browser, page, f"episode {columns['episode'][last]} ")
    until_shown(browser, page, f"{x:.4f}, {y:.4f} m".replace("-", "−"), "#facts")
    until_shown(browser, page, "5 episodes", ".tiles")
    goals = int(np.count_nonzero(columns["goal"][-150:]))
    assert f"goal ({goals})" in text(browser, "#jumps") or goals == 0
    browser.click("#previous-episode")
    browser.click("#previous-episode")
    until_shown(browser, page, f"episode {columns['episode'][last] - 1} ")
    assert text(browser, "h1") == "<b>a match</b>"
    assert browser.complaints == []


def test_buttons_and_keys_ask_for_what_the_terminal_has_keys_for(run: Run, page: BrowserPage, browser: Browser) -> None:
    for message in list(run.messages())[:60]:
        page.hear(message.topic, message.data)
    browser.open(page.address)
    browser.wait_for(lambda: [*page.keys()] or page.draw() or browser.evaluate(READY), "the first step")
    until_shown(browser, page, "1 x real time", "#live")

    def asked() -> list[Key]:
        found: list[Key] = []
        browser.wait_for(lambda: found.extend(page.keys()) or found, "what was asked for")
        return found

    for act, key in (
        (lambda: browser.click("#play"), Key.PAUSE),
        (lambda: browser.key(" "), Key.PAUSE),
        (lambda: browser.click("#forth"), Key.STEP),
        (lambda: browser.key("+"), Key.FASTER),
        (lambda: browser.key("-"), Key.SLOWER),
        (lambda: browser.key("e"), Key.NEXT),
    ):
        browser.evaluate("document.activeElement.blur()")
        act()
        assert asked() == [key]
    browser.evaluate(
        "(() => { const e = document.getElementById('speed'); e.value = 8; e.dispatchEvent(new Event('change')); })()"
    )
    found: list[Key] = []
    browser.wait_for(lambda: found.extend(page.keys()) or len(found) == 3, "three times faster")
    assert found == [Key.FASTER] * 3
