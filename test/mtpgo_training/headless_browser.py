# Copyright 2026 the mtpgo_ros developers
# SPDX-License-Identifier: Apache-2.0
"""A headless Chromium, driven by the Chrome DevTools protocol over a pair of pipes."""

import base64
import contextlib
import json
import os
import select
import shutil
import subprocess
import time

BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--remote-debugging-pipe",
)
LIMIT_S = 90.0
"""Longest wait for an answer (s); chosen: the start on a machine that is busy with other work."""


def find_browser():
    """Return the path of an installed browser, None without one."""
    return next(filter(None, map(shutil.which, BROWSERS)), None)


class HeadlessBrowser:
    """One tab of a browser.

    Attributes:
        problems: texts of errors and warnings that pages wrote or raised.
    """

    def __init__(self, profile, size=(1280, 800)):
        self.problems = []
        reads, self._out = os.pipe()
        self._in, writes = os.pipe()
        size = f"--window-size={size[0]},{size[1]}"
        # The protocol's pipes are the file descriptors 3 and 4.
        command = f'exec "$0" "$@" 3<&{reads} 4>&{writes}'
        program = [find_browser(), *FLAGS, f"--user-data-dir={profile}", size, "about:blank"]
        self._process = subprocess.Popen(
            ["bash", "-c", command, *program],
            pass_fds=(reads, writes),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            start_new_session=True,
        )
        os.close(reads)
        os.close(writes)
        self._rest, self._number, self._session = b"", 0, None
        targets = self.call("Target.getTargets")["targetInfos"]
        page = next(target["targetId"] for target in targets if target["type"] == "page")
        attached = self.call("Target.attachToTarget", targetId=page, flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log"):
            self.call(f"{domain}.enable")

    def close(self):
        """End the browser."""
        with contextlib.suppress(OSError, TimeoutError):
            self._send("Browser.close", {}, session=False)
        try:
            self._process.wait(20)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        os.close(self._in)
        os.close(self._out)

    def call(self, method, **parameters):
        """Call a method of the protocol and return its result."""
        number = self._send(method, parameters)
        while True:
            message = self._receive()
            if message.get("id") == number:
                assert "error" not in message, f"{method}: {message['error']}"
                return message["result"]
            self._note(message)

    def open(self, url):
        """Load a page and wait until its viewer is there."""
        self.call("Page.navigate", url=url)
        self.wait_for("Boolean(window.viewer) && !window.viewer.dirty")

    def value(self, expression):
        """Return the value of an expression; promises are awaited."""
        answer = self.call(
            "Runtime.evaluate", expression=expression, awaitPromise=True, returnByValue=True
        )
        assert "exceptionDetails" not in answer, answer["exceptionDetails"]
        return answer["result"].get("value")

    def wait_for(self, expression):
        """Wait until an expression is true."""
        end = time.monotonic() + LIMIT_S
        while not self.value(expression):
            assert time.monotonic() < end, f"{expression} did not become true: {self.problems}"
            time.sleep(0.05)

    def screenshot(self):
        """Return a PNG of the page."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def resize(self, width, height, mobile=False, scale=1):
        """Give the page another size (CSS pixels)."""
        self.call(
            "Emulation.setDeviceMetricsOverride",
            width=width,
            height=height,
            deviceScaleFactor=scale,
            mobile=mobile,
        )

    def _send(self, method, parameters, session=True):
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if session and self._session:
            message["sessionId"] = self._session
        os.write(self._out, json.dumps(message).encode() + b"\0")
        return self._number

    def _receive(self):
        while b"\0" not in self._rest:
            ready, _, _ = select.select([self._in], [], [], LIMIT_S)
            if not ready:
                raise TimeoutError(f"the browser did not answer within {LIMIT_S:g} s")
            data = os.read(self._in, 1 << 20)
            if not data:
                raise TimeoutError("the browser ended")
            self._rest += data
        text, _, self._rest = self._rest.partition(b"\0")
        return json.loads(text)

    def _note(self, message):
        method, parameters = message.get("method"), message.get("params", {})
        if method == "Runtime.exceptionThrown":
            self.problems.append(str(parameters["exceptionDetails"]))
        elif method == "Runtime.consoleAPICalled" and parameters["type"] in ("error", "warning"):
            self.problems.append(str(parameters["args"]))
        elif method == "Log.entryAdded" and parameters["entry"]["level"] in ("error", "warning"):
            self.problems.append(str(parameters["entry"]))
