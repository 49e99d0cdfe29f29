"""A headless Chromium, driven by the DevTools protocol over two pipes: no port, no network, nothing to install."""

from __future__ import annotations

import base64
import json
import os
import select
import shutil
import subprocess
from pathlib import Path
from time import monotonic
from typing import Any

from patience import PATIENCE_S

NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable", "chrome")
CODES = {"Enter": 13, "ArrowLeft": 37, "ArrowRight": 39}
"""Of keys that controls of the browser's own look at."""


def browser_path() -> str | None:
    """The browser on this machine, if there is one."""
    return next((found for name in NAMES if (found := shutil.which(name))), None)


class Browser:
    """One page in one browser, which ends with it. What the page logs and asks the network for is collected.

    Args:
        profile: a directory of its own.
    """

    def __init__(self, path: str, profile: Path, width: int = 1280, height: int = 900) -> None:
        down_read, self._down = os.pipe()
        self._up, up_write = os.pipe()
        flags = ["--headless=new", "--no-sandbox", "--disable-gpu", "--no-first-run", "--disable-background-networking"]
        flags += ["--disable-component-update", "--disable-sync", f"--user-data-dir={profile}"]

        def pipes() -> None:
            os.dup2(down_read, 3)
            os.dup2(up_write, 4)

        # 3 and 4 are where the protocol looks; they must stay open in the child only.
        self._process = subprocess.Popen(
            [path, *flags, "--remote-debugging-pipe", "about:blank"],
            preexec_fn=pipes,
            pass_fds=(3, 4),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(down_read)
        os.close(up_write)
        self._buffer = b""
        self._number = 0
        self._session: str | None = None
        self.events: list[tuple[str, dict[str, Any]]] = []
        """What the browser told by itself: name and values."""
        targets = self.call("Target.getTargets")["targetInfos"]
        page = next(target["targetId"] for target in targets if target["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        self.resize(width, height)

    def __enter__(self) -> Browser:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait(PATIENCE_S)
        os.close(self._down)
        os.close(self._up)

    def call(self, method: str, **parameters: Any) -> dict[str, Any]:
        """One command of the protocol and its result."""
        self._number += 1
        message: dict[str, Any] = {"id": self._number, "method": method, "params": parameters}
        if self._session is not None:
            message["sessionId"] = self._session
        os.write(self._down, json.dumps(message).encode() + b"\0")
        while True:
            answer = self._receive(method)
            if answer.get("id") == self._number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]
            if "method" in answer:
                self.events.append((answer["method"], answer["params"]))

    def open(self, page: str) -> None:
        """Opens an address and waits until it is loaded."""
        before = len(self.events)
        self.call("Page.navigate", url=page)
        self.wait_for(lambda: any(name == "Page.loadEventFired" for name, _ in self.events[before:]), f"{page} loaded")

    def evaluate(self, expression: str) -> Any:
        """The value of a JavaScript expression, which may be a promise."""
        found = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in found, f"{expression}: {found['exceptionDetails']}"
        return found["result"].get("value")

    def wait_for(self, condition: Any, what: str) -> None:
        """Waits until a condition holds: a function, or a JavaScript expression."""
        end = monotonic() + PATIENCE_S
        while not (self.evaluate(condition) if isinstance(condition, str) else condition()):
            assert monotonic() < end, f"waited {PATIENCE_S:g} s for {what}"
            # The browser answers when it is through with what it is doing, so that this is no busy loop.
            self.evaluate("new Promise((done) => setTimeout(done, 20))")

    def key(self, key: str, shift: bool = False) -> None:
        """Presses and releases a key."""
        text = {"text": "\r" if key == "Enter" else key} if len(key) == 1 or key == "Enter" else {}
        code = {"windowsVirtualKeyCode": CODES[key]} if key in CODES else {}
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=key, modifiers=8 if shift else 0, **code, **text)
            text = {}

    def click(self, selector: str, share: float = 0.5) -> None:
        """Clicks on an element, as far from its left edge as `share` says."""
        box = self.evaluate(
            f"(() => {{ const e = document.querySelector({json.dumps(selector)}); e.scrollIntoView({{block: 'center'}});"
            " const b = e.getBoundingClientRect(); return [b.left, b.top, b.width, b.height]; })()"
        )
        left, top, width, height = box
        place = {"x": left + width * share, "y": top + height / 2}
        for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
            pressed = {} if kind == "mouseMoved" else {"button": "left", "clickCount": 1}
            self.call("Input.dispatchMouseEvent", type=kind, **place, **pressed)

    def resize(self, width: int, height: int) -> None:
        """The size of the window [CSS pixels]."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def prefer(self, **features: str) -> None:
        """What the system prefers, as prefers_color_scheme="dark"."""
        chosen = [{"name": name.replace("_", "-"), "value": value} for name, value in features.items()]
        self.call("Emulation.setEmulatedMedia", features=chosen)

    def screenshot(self, path: Path, whole: bool = True) -> None:
        """Writes a PNG of the page, or of the window."""
        data = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole)["data"]
        path.write_bytes(base64.b64decode(data))

    @property
    def complaints(self) -> list[str]:
        """Errors and warnings on the console, and exceptions, since the beginning."""
        found: list[str] = []
        for name, values in self.events:
            if name == "Runtime.exceptionThrown":
                details = values["exceptionDetails"]
                found.append(str(details.get("exception", {}).get("description", details["text"])))
            elif name == "Log.entryAdded" and values["entry"]["level"] in ("error", "warning"):
                found.append(values["entry"]["text"])
            elif name == "Runtime.consoleAPICalled" and values["type"] in ("error", "warning", "assert"):
                found.append(str(values["args"]))
        return found

    @property
    def requests(self) -> list[str]:
        """What was asked for, over the network or of the machine's files, since the beginning."""
        return [values["request"]["url"] for name, values in self.events if name == "Network.requestWillBeSent"]

    def _receive(self, what: str) -> dict[str, Any]:
        end = monotonic() + PATIENCE_S
        while b"\0" not in self._buffer:
            left_s = max(0.0, end - monotonic())
            assert select.select([self._up], [], [], left_s)[0], f"no answer to {what} in {PATIENCE_S:g} s"
            data = os.read(self._up, 1 << 20)
            assert data, f"the browser ended before it answered {what}"
            self._buffer += data
        message, _, self._buffer = self._buffer.partition(b"\0")
        return json.loads(message)
