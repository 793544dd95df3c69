"""A tab of headless Chromium that one can look at while its page runs, over the browser's own pipe (Chrome DevTools
Protocol, https://chromedevtools.github.io/devtools-protocol/)."""

import base64
import json
import os
import subprocess
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

import gyrotwin as gt
from benchmarks.pages import FLAGS, browser

PATIENCE: Final = 60.0
"""Longest wait [s] for an answer of the browser or of the page."""


class Tab:
    """The page at ``url`` in a window of ``width`` by ``height`` CSS pixels, light or ``dark``; a context manager.

    ``console`` holds what the page has said there, errors included.
    """

    def __init__(self, url: str, width: int = 1200, height: int = 900, *, dark: bool = False) -> None:
        self._url, self._size, self._dark = url, (width, height), dark
        self.console: list[str] = []
        self._number, self._rest, self._session = 0, b"", ""

    def __enter__(self) -> Self:
        command = browser()
        if command is None:
            raise gt.InputError("no browser: install chromium")
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        # The browser reads commands from its descriptor 3 and answers on 4.
        (theirs_in, self._out), (self._in, theirs_out) = os.pipe(), os.pipe()
        arguments = [*FLAGS, f"--user-data-dir={self._profile.name}", "--remote-debugging-pipe", "about:blank"]
        line = f'exec "$0" "$@" 3<&{theirs_in} 4>&{theirs_out}'
        self._process = subprocess.Popen(
            ["bash", "-c", line, command, *arguments],
            pass_fds=(theirs_in, theirs_out), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )  # fmt: skip
        os.close(theirs_in)
        os.close(theirs_out)
        os.set_blocking(self._in, False)
        pages = self.call("Target.getTargets")["targetInfos"]
        target = next(page["targetId"] for page in pages if page["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")
        width, height = self._size
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if self._dark else "light"}
        self.call("Emulation.setEmulatedMedia", features=[scheme])
        self.call("Page.navigate", url=self._url)
        self.wait("document.readyState === 'complete' && location.href !== 'about:blank'")
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._process.terminate()
        self._process.wait(timeout=PATIENCE)
        os.close(self._in)
        os.close(self._out)
        self._profile.cleanup()

    def call(self, method: str, **parameters: Any) -> Mapping[str, Any]:
        """The answer to a command of the protocol. Raises RuntimeError where the browser refuses it."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        message |= {"sessionId": self._session} if self._session else {}
        os.write(self._out, json.dumps(message).encode() + b"\0")
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            for answer in self._read():
                if answer.get("id") == self._number:
                    if "error" in answer:
                        raise RuntimeError(f"{method}: {answer['error']['message']}")
                    return dict(answer["result"])
        raise RuntimeError(f"{method}: no answer from the browser")

    def run(self, script: str) -> Any:
        """The value of an expression in the page; a promise is awaited. Raises RuntimeError where it throws."""
        done = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in done:
            raise RuntimeError(str(done["exceptionDetails"].get("exception", {}).get("description")))
        return done["result"].get("value")

    def wait(self, condition: str) -> None:
        """Waits until an expression in the page is true. Raises RuntimeError where that takes too long."""
        end = time.monotonic() + PATIENCE
        while not self.run(f"Boolean({condition})"):
            if time.monotonic() > end:
                raise RuntimeError(f"not within {PATIENCE:g} s: {condition}; console: {self.console}")
            time.sleep(0.05)

    def key(self, name: str, code: int) -> None:
        """Presses and lets go a key by name and code, such as ArrowRight, 39."""
        for kind in ("keyDown", "keyUp"):
            self.call("Input.dispatchKeyEvent", type=kind, key=name, code=name, windowsVirtualKeyCode=code)

    def drag(self, begin: tuple[float, float], end: tuple[float, float]) -> None:
        """Presses the mouse at ``begin``, lets it go at ``end``; x and y in CSS pixels of the window."""
        for kind, (x, y) in (("mousePressed", begin), ("mouseMoved", end), ("mouseReleased", end)):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def picture(self, *, whole: bool = False, clip: Mapping[str, float] | None = None) -> bytes:
        """A screenshot as PNG: of the window, of the ``whole`` page, or of ``clip`` (x, y, width, height, scale)."""
        where = {"clip": dict(clip)} if clip else {}
        shot = self.call("Page.captureScreenshot", format="png", captureBeyondViewport=whole or bool(clip), **where)
        return base64.b64decode(shot["data"])

    def _read(self) -> list[dict[str, Any]]:
        """The messages that have come; remembers what the console says."""
        try:
            self._rest += os.read(self._in, 1 << 20)
        except BlockingIOError:
            time.sleep(0.005)
            return []
        *whole, self._rest = self._rest.split(b"\0")
        messages = [json.loads(text) for text in whole]
        for message in messages:
            event = message.get("params", {})
            if message.get("method") == "Runtime.exceptionThrown":
                details = event["exceptionDetails"]
                self.console.append(str(details.get("exception", {}).get("description") or details["text"]))
            elif message.get("method") == "Runtime.consoleAPICalled":
                self.console.append(" ".join(str(argument.get("value")) for argument in event["args"]))
            elif message.get("method") == "Log.entryAdded":
                self.console.append(event["entry"]["text"])
        return messages


def url_of(page: Path) -> str:
    """The address of a file."""
    return page.resolve().as_uri()
