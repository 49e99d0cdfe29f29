"""The report's page in a real browser: clicked and typed through, without a complaint and without a request."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browser import Browser, browser_path
from fbql.report.page import write_page
from fbql_behaviors.core.explanation import rules
from fbql_behaviors.storage import load_tree
from fbql_recording.run import open_run
from hostile_run import hostile_run
from recorded_match import TREES, record_match
from rewritten_run import rewrite

BROWSER = browser_path()
pytestmark = pytest.mark.skipif(BROWSER is None, reason="no Chromium or Chrome on this machine")
READY = "!document.getElementById('player').hasAttribute('aria-busy')"
PHONE, DESKTOP = 360, 1280


def page_of(run: Path, page: Path) -> Path:
    with page.open("w", encoding="utf-8") as file:
        write_page(open_run(run), file, lambda _: None)
    return page


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight episodes of Subsumption with the paper's thresholds: own goals, time limits and collisions. Not to be changed."""
    directory = tmp_path_factory.mktemp("recorded") / "run"
    return record_match(directory, controller="subsumption", preset="paper", episodes=8, max_steps=700)


@pytest.fixture(scope="module")
def page(recorded: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return page_of(recorded, tmp_path_factory.mktemp("page") / "page.html")


@pytest.fixture(scope="module")
def columns(recorded: Path) -> dict[str, Any]:
    return open_run(recorded).arrays()


@pytest.fixture(scope="module")
def one_browser(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Browser]:
    """It takes a second to start: the tests share it, each with a page loaded anew."""
    assert BROWSER is not None
    with Browser(BROWSER, tmp_path_factory.mktemp("profile"), DESKTOP) as browser:
        yield browser


@pytest.fixture
def browser(one_browser: Browser, page: Path) -> Iterator[Browser]:
    """The page, opened. At the end of each test nothing was complained about, and nothing asked for but the page."""
    one_browser.events.clear()
    one_browser.resize(DESKTOP, 900)
    one_browser.prefer()
    one_browser.open(page.as_uri())
    one_browser.wait_for(READY, "the page to be ready")
    yield one_browser
    one_browser.evaluate("0")
    assert one_browser.complaints == []
    assert set(one_browser.requests) == {page.as_uri()}


def step_of(browser: Browser) -> int:
    """The step that is shown, as the address says it."""
    settle(browser)
    return int(browser.evaluate("location.hash").removeprefix("#step="))


def settle(browser: Browser) -> None:
    """Until what was changed is drawn: twice, since drawing waits for the browser's next picture."""
    browser.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")


def seek(browser: Browser, step: int) -> None:
    browser.evaluate(f"location.hash = '#step={step}'")
    browser.wait_for(f"location.hash === '#step={step}'", "the address")
    settle(browser)


def text(browser: Browser, selector: str) -> str:
    return browser.evaluate(f"document.querySelector({selector!r}).textContent")


def fact(browser: Browser, name: str) -> str:
    return browser.evaluate(
        f"[...document.querySelectorAll('#facts dt')].find((e) => e.textContent === {name!r}).nextElementSibling.textContent"
    )


def where(column: Any, step: int) -> int:
    """The first row after a step in which a column is true."""
    return step + 1 + int(np.flatnonzero(column[step + 1 :])[0])


# What it shows


def test_numbers_and_words_are_those_of_the_recording(browser, columns):
    trees = [load_tree(TREES / f"{name}.json") for name in ("ball_seeking", "wall_avoiding", "approaching")]
    steps = np.random.default_rng(1).integers(len(columns["step"]), size=12)
    for step in map(int, steps):
        seek(browser, step)
        told = fact(browser, "command")
        expected = [f"{columns[f'command_{side}_rad_s'][step]:.2f}" for side in ("left", "right")]
        assert re.findall(r"[−\d.]+", told) == [each.replace("-0.00", "0.00").replace("-", "−") for each in expected]
        assert fact(browser, "joint state") == f"({', '.join(map(str, columns['joint_state'][step]))})"
        assert float(fact(browser, "reward").replace("−", "-")) == pytest.approx(columns["reward"][step])
        x, y = (columns[f"robot_{axis}_m"][step] for axis in "xy")
        assert fact(browser, "robot at").replace("−", "-") == f"{x:.4f}, {y:.4f} m"
        cards = browser.evaluate("[...document.querySelectorAll('.behavior')].map((e) => e.textContent)")
        for k, (card, tree) in enumerate(zip(cards, trees, strict=True)):
            rule = rules(tree)[columns["leaf_id"][step, k]]
            assert f"{rule.where} → {rule.what}" in card
            assert f"weight {columns['weights'][step, k]:.4f}" in card
            assert "Q n/a" in card  # Subsumption has none
            left = f"{columns['reference_left_rad_s'][step, k]:.2f}".replace("-", "−")
            assert f"{left} left" in card


def test_who_drives_and_why_is_said(browser, columns):
    step = int(np.flatnonzero(columns["driver"] == 1)[0])
    seek(browser, step)
    why = text(browser, "#why")
    rule = rules(load_tree(TREES / "wall_avoiding.json"))[columns["leaf_id"][step, 1]]
    assert "wall_avoiding drives alone" in why and rule.where in why and rule.what in why
    assert "the wall is nearer than" in browser.evaluate("document.body.textContent")


def test_the_words_of_a_rule_are_explained_where_they_stand(browser):
    is_open = "document.querySelector('.behavior:nth-child(3) .sensed').open"
    assert not browser.evaluate(is_open)
    browser.click(".behavior:nth-child(3) summary")
    assert browser.evaluate(is_open)
    assert "(in the rules: the detour)" in text(browser, ".behavior:nth-child(3) .sensed p")
    settle(browser)
    browser.evaluate("document.querySelector('.behavior:nth-child(1) summary').focus()")
    browser.key("Enter")
    assert "how far the ball is away" in text(browser, ".behavior:nth-child(1) details[open] p")


def test_a_second_leads_to_its_step(browser, columns):
    browser.evaluate("document.getElementById('second').focus()")
    browser.evaluate("document.getElementById('second').value = ''")
    browser.call("Input.insertText", text="7.3")
    browser.key("Enter")
    nearest = int(np.argmin(np.abs(columns["stamp_ns"] / 1e9 - 7.3)))
    browser.wait_for(f"location.hash === '#step={nearest}'", "the step at 7.3 s")


# Its controls


@pytest.mark.parametrize(
    ("name", "key", "column"),
    [("goal", "g", "goal"), ("own_goal", "o", "own_goal"), ("collision", "c", "collision_begun")],
)
def test_buttons_and_keys_jump_to_events(browser, columns, name, key, column):
    seek(browser, 0)
    first = where(columns[column], 0)
    browser.click(f"#next-{name}")
    assert step_of(browser) == first
    seek(browser, 0)
    browser.evaluate("document.activeElement.blur()")
    browser.key(key)
    assert step_of(browser) == first
    seek(browser, len(columns["step"]) - 1)
    last = int(np.flatnonzero(columns[column][:-1])[-1])
    browser.key(key.upper(), shift=True)
    assert step_of(browser) == last


def test_episodes_are_reached_by_button_key_table_and_timeline(browser, columns):
    begins = np.flatnonzero(np.diff(columns["episode"], prepend=-1))
    seek(browser, 0)
    browser.click("#next-episode")
    assert step_of(browser) == begins[1]
    browser.evaluate("document.activeElement.blur()")
    browser.key("e")
    assert step_of(browser) == begins[2]
    browser.click("[data-episode='4']")
    assert step_of(browser) == begins[4]
    assert browser.evaluate("document.querySelector('tr[aria-current]').querySelector('button').textContent") == "4"
    browser.click("#run-strips .strip:nth-child(3) canvas", share=0.99)
    assert step_of(browser) == begins[-1]
    browser.click("#episode-strips .strip canvas", share=0.5)
    assert begins[-1] < step_of(browser) < len(columns["step"]) - 1


def test_steps_go_back_and_forth(browser, columns):
    seek(browser, 100)
    for key, expected in [("ArrowRight", 101), ("ArrowLeft", 100), ("Home", 0), ("ArrowLeft", 0)]:
        browser.key(key)
        assert step_of(browser) == expected
    browser.key("ArrowRight", shift=True)
    assert step_of(browser) == 60
    browser.key("End")
    assert step_of(browser) == np.flatnonzero(columns["episode"] == 0)[-1]
    browser.click("#back")
    browser.click("#forth")
    assert step_of(browser) == np.flatnonzero(columns["episode"] == 0)[-1]


def test_it_plays_and_pauses(browser):
    seek(browser, 0)
    browser.evaluate("document.getElementById('speed').value = '8'")
    browser.evaluate("document.getElementById('speed').dispatchEvent(new Event('change'))")
    browser.click("#play")
    browser.wait_for("document.getElementById('play').getAttribute('aria-label') === 'Pause'", "it to play")
    browser.wait_for("Number(document.getElementById('scrub').value) > 30", "thirty steps")
    browser.evaluate("document.activeElement.blur()")
    browser.key(" ")
    browser.wait_for("document.getElementById('play').getAttribute('aria-label') === 'Play'", "it to pause")
    step = step_of(browser)
    assert step > 30
    settle(browser)
    assert step_of(browser) == step


def test_it_plays_as_fast_as_it_says(browser, columns):
    seek(browser, 0)
    browser.key("+")
    browser.key("+")
    played = browser.evaluate(
        """new Promise((done) => {
            const begun = performance.now();
            document.getElementById('play').click();
            const look = () => {
                const step = Number(document.getElementById('scrub').value);
                if (step < 60) return requestAnimationFrame(look);
                document.getElementById('play').click();
                done([step, performance.now() - begun]);
            };
            look();
        })"""
    )
    step, milliseconds = played
    of_the_run = (columns["stamp_ns"][step] - columns["stamp_ns"][0]) / 1e6
    assert of_the_run / 4 <= milliseconds + 20  # 4 times as fast, and not faster: a slow machine may be late


def test_the_scrub_bar_works_by_keyboard(browser):
    seek(browser, 10)
    browser.evaluate("document.getElementById('scrub').focus()")
    browser.key("ArrowRight")
    assert step_of(browser) == 11


def test_every_control_has_a_name_and_the_field_is_told_in_words(browser):
    nodes = browser.call("Accessibility.getFullAXTree")["nodes"]
    roles = {"button", "slider", "combobox", "spinbutton", "image", "region", "group"}
    named = [(node["role"]["value"], node.get("name", {}).get("value", "")) for node in nodes if "role" in node]
    found = [(role, name) for role, name in named if role in roles]
    assert len(found) > 20
    assert [role for role, name in found if not name.strip() and role != "group"] == []
    assert any(role == "image" and name.startswith("The field: robot at") for role, name in found)


# Where it is shown


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [PHONE, DESKTOP])
def test_nothing_sticks_out_at_any_width_in_either_scheme(browser, width, scheme):
    browser.prefer(prefers_color_scheme=scheme)
    browser.resize(width, 800)
    settle(browser)
    assert browser.evaluate("document.documentElement.scrollWidth - document.documentElement.clientWidth") == 0
    assert browser.evaluate("document.getElementById('field').clientWidth") > 0.45 * width
    outside = browser.evaluate(
        "[...document.querySelectorAll('main button, main select, main input, main p, main dd')]"
        ".filter((e) => e.getBoundingClientRect().right > document.documentElement.clientWidth).length"
    )
    assert outside == 0


def test_the_field_follows_the_colour_scheme(browser):
    paper = "getComputedStyle(document.getElementById('field')).backgroundColor"
    seen: set[str] = set()
    for scheme in ("light", "dark"):
        browser.prefer(prefers_color_scheme=scheme)
        settle(browser)
        seen.add(str(browser.evaluate(paper)))
        wall = browser.evaluate("getComputedStyle(document.documentElement).getPropertyValue('--wall')")
        colours = browser.evaluate(
            """(() => {
                const field = document.getElementById('field');
                const canvas = document.createElement('canvas');
                [canvas.width, canvas.height] = [field.width, field.height];
                const pen = canvas.getContext('2d');
                pen.drawImage(field, 0, 0);
                const data = pen.getImageData(0, 0, canvas.width, canvas.height).data;
                const found = new Set();
                for (let i = 0; i < data.length; i += 4)
                    if (data[i + 3] === 255)
                        found.add('#' + [0, 1, 2].map((k) => data[i + k].toString(16).padStart(2, '0')).join(''));
                return [...found];
            })()"""
        )
        assert wall in colours
    assert len(seen) == 2


def test_with_reduced_motion_there_are_few_pictures(browser):
    browser.prefer(prefers_reduced_motion="reduce")
    seek(browser, 0)
    pictures = browser.evaluate(
        """new Promise((done) => {
            const seen = new Set();
            const begun = performance.now();
            document.getElementById('play').click();
            const look = (now) => {
                seen.add(document.getElementById('scrub').value);
                if (now - begun < 1100) return requestAnimationFrame(look);
                document.getElementById('play').click();
                done(seen.size);
            };
            requestAnimationFrame(look);
        })"""
    )
    assert 2 <= pictures <= 6


# What others make of it


def test_a_hostile_recording_runs_nothing(one_browser, tmp_path):
    page = page_of(hostile_run(tmp_path / "run"), tmp_path / "page.html")
    one_browser.events.clear()
    one_browser.open(page.as_uri())
    one_browser.wait_for(READY, "the page to be ready")
    assert one_browser.evaluate("document.images.length") == 0
    assert "alert(1)" in text(one_browser, "#facts")
    assert "alert(4)" in text(one_browser, ".behavior h3")
    assert not [name for name, _ in one_browser.events if name == "Page.javascriptDialogOpening"]
    assert one_browser.complaints == []
    assert one_browser.requests == [page.as_uri()]


WORLD, DECISION = "/world", "/fusion/decision"


@pytest.mark.parametrize(
    "kept", [{WORLD}, {DECISION}, {WORLD, "/behaviors/approaching"}], ids=["world", "decision", "both"]
)
def test_what_was_not_recorded_is_not_available(one_browser, recorded, tmp_path, kept):
    copy = rewrite(recorded, tmp_path / "run", lambda message: message.data if message.topic in kept else None)
    page = page_of(copy, tmp_path / "page.html")
    one_browser.events.clear()
    one_browser.open(page.as_uri())
    one_browser.wait_for(READY, "the page to be ready")
    settle(one_browser)
    assert fact(one_browser, "command") == "n/a left, n/a right [rad/s]"
    assert (fact(one_browser, "robot at") == "n/a, n/a m") == (WORLD not in kept)
    assert (fact(one_browser, "joint state") == "(n/a, n/a, n/a)") == (DECISION not in kept)
    assert ("goal (n/a)" in text(one_browser, "#jumps")) == (WORLD not in kept)
    assert ("n/a goals" in text(one_browser, ".tiles")) == (WORLD not in kept)
    cards = one_browser.evaluate("[...document.querySelectorAll('.behavior')].map((e) => e.textContent)")
    answered = ["no answer was recorded" not in card for card in cards]
    assert answered == [False, False, "/behaviors/approaching" in kept]
    assert one_browser.complaints == []


@pytest.mark.parametrize("damage", ["old browser", "damaged block"])
def test_what_can_not_be_unpacked_is_said(one_browser, page, tmp_path, damage):
    source = page.read_text(encoding="utf-8")
    script = None
    if damage == "damaged block":
        begin = source.index('class="block">') + 200
        source = source[:begin] + source[begin : begin + 40].swapcase() + source[begin + 40 :]
    else:
        script = one_browser.call("Page.addScriptToEvaluateOnNewDocument", source="delete window.DecompressionStream")
    changed = tmp_path / "page.html"
    changed.write_text(source, encoding="utf-8")
    try:
        one_browser.open(changed.as_uri())
        one_browser.wait_for("!document.getElementById('trouble').hidden", "the message")
    finally:
        if script is not None:
            one_browser.call("Page.removeScriptToEvaluateOnNewDocument", identifier=script["identifier"])
    words = text(one_browser, "#trouble")
    assert ("too old" if damage == "old browser" else "can't be shown") in words
    assert one_browser.evaluate("document.querySelectorAll('[data-episode]').length") == 8
