"""Chromium without a window, led by the protocol of its developer tools over two pipes: no port, no driver."""

import fcntl
import json
import os
import shutil
import subprocess

import pytest

from tests.experiments.explore.browser import Browser, PageLeftError

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
chromium_needed = pytest.mark.skipif(
    BROWSER is None, reason="no Chromium on this machine: install it, as by 'apt install chromium'"
)
# What the protocol answers where a link is followed before an expression has its value.
PAGE_LEFT = ("Inspected target navigated or closed", "Execution context was destroyed.")
KEYS = {"ArrowRight": 39, "ArrowLeft": 37, "ArrowDown": 40, "Tab": 9, "Enter": 13, " ": 32}


class Chromium(Browser):
    """A page in a browser of its own; what it asks the network for is kept in ``requested``."""

    def __init__(self, folder, width=1280, height=900):
        outward, inward = os.pipe(), os.pipe()
        read, write = (fcntl.fcntl(fd, fcntl.F_DUPFD, 10) for fd in (outward[0], inward[1]))
        options = (
            "--headless=new",
            "--no-sandbox",
            "--disable-gpu",
            "--remote-debugging-pipe",
            f"--user-data-dir={folder}",
        )
        command = f'exec "$@" 3<&{read} 4>&{write}'
        self._process = subprocess.Popen(
            ["bash", "-c", command, "bash", BROWSER, *options, "about:blank"],
            pass_fds=(read, write),
            stderr=subprocess.DEVNULL,
        )
        for fd in (outward[0], inward[1], read, write):
            os.close(fd)
        self._to, self._from = os.fdopen(outward[1], "wb", 0), os.fdopen(inward[0], "rb", 0)
        self._count, self._rest, self._session, self.requested, self.errors = 0, b"", None, [], []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self._session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Network", "Runtime"):
            self.call(f"{domain}.enable")
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=False)

    def __exit__(self, *_):
        self._to.close()
        try:
            self._process.wait(5)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        self._from.close()

    def call(self, method, **parameters):
        """The result of a method; events that come before it are looked at."""
        self._count += 1
        message = {"id": self._count, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        self._to.write(json.dumps(message).encode() + b"\0")
        while True:
            got = self._message()
            if got.get("id") == self._count:
                if "error" in got:
                    raise (PageLeftError if got["error"]["message"] in PAGE_LEFT else AssertionError)(got)
                return got["result"]

    def _message(self):
        while b"\0" not in self._rest:
            more = self._from.read(1 << 16)
            assert more, "the browser has gone"
            self._rest += more
        first, _, self._rest = self._rest.partition(b"\0")
        got = json.loads(first)
        if got.get("method") == "Network.requestWillBeSent":
            self.requested.append(got["params"]["request"]["url"])
        if got.get("method") == "Runtime.exceptionThrown":
            self.errors.append(got["params"]["exceptionDetails"])
        return got

    def open(self, address):
        """Go to an address."""
        self.call("Page.navigate", url=address)

    def value(self, expression):
        """What an expression of JavaScript gives; a promise is awaited."""
        got = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in got, got["exceptionDetails"]
        return got["result"].get("value")

    def key(self, name):
        """Press and release a key."""
        about = {"key": name, "windowsVirtualKeyCode": KEYS.get(name, ord(name[0].upper()))}
        text = {"text": "\r" if name == "Enter" else name} if name == "Enter" or len(name) == 1 else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", **about, **text)
        self.call("Input.dispatchKeyEvent", type="keyUp", **about)

    def type(self, text):
        """Type a text, in place of what is selected."""
        self.call("Input.insertText", text=text)

    def choose_file(self, selector, path):
        """Choose a file in a file field."""
        root = self.call("DOM.getDocument")["root"]["nodeId"]
        field = self.call("DOM.querySelector", nodeId=root, selector=selector)["nodeId"]
        self.call("DOM.setFileInputFiles", nodeId=field, files=[str(path)])
