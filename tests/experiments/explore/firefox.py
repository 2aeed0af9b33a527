"""Firefox without a window, led by its own protocol, Marionette: JSON over a socket of this machine, no driver."""

import json
import shutil
import socket
import subprocess
import time

import pytest

from tests.experiments.explore.browser import PATIENCE, Browser

BROWSER = shutil.which("firefox-esr") or shutil.which("firefox")
firefox_needed = pytest.mark.skipif(
    BROWSER is None, reason="no Firefox on this machine: install it, as by 'apt install firefox-esr'"
)
KEYS = {"ArrowLeft": "\ue012", "ArrowRight": "\ue014", "ArrowDown": "\ue015", "Tab": "\ue004", "Enter": "\ue007"}
# Errors of the page's scripts are kept by the browser; warnings, as of a style that it does not know, are left out.
ERRORS = """return Services.console.getMessageArray().flatMap((one) => one instanceof Ci.nsIScriptError &&
  !(one.flags & Ci.nsIScriptError.warningFlag) && /^(file|blob|http)/.test(one.sourceName) ? [one.message] : []);"""


class Firefox(Browser):
    """A page in a Firefox of its own."""

    def __init__(self, folder, width=1280, height=900):
        folder.mkdir(parents=True)
        (folder / "user.js").write_text('user_pref("marionette.port", 0);\n', encoding="utf-8")
        options = ("--headless", "--marionette", "--remote-allow-system-access", "--profile", str(folder))
        self._process = subprocess.Popen(
            [BROWSER, *options, f"--width={width}", f"--height={height}"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        self._socket, self._count, self._rest = self._connected(folder / "MarionetteActivePort"), 0, b""
        self._message()  # its greeting
        self.call("WebDriver:NewSession", capabilities={"alwaysMatch": {"pageLoadStrategy": "none"}})

    def _connected(self, told):
        """A socket to the port that the browser has told in a file."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end and self._process.poll() is None:
            if told.exists() and (port := told.read_text(encoding="utf-8").strip()):
                return socket.create_connection(("127.0.0.1", int(port)), PATIENCE)
            time.sleep(0.02)
        self._process.kill()
        raise AssertionError("Firefox did not start")

    def __exit__(self, *_):
        self._socket.close()
        self._process.terminate()
        self._process.wait(PATIENCE)

    def call(self, method, **parameters):
        """The result of a method."""
        self._count += 1
        text = json.dumps([0, self._count, method, parameters]).encode()
        self._socket.sendall(b"%d:%s" % (len(text), text))
        _, _, error, result = self._message()
        assert error is None, error
        return result

    def _message(self):
        while b":" not in self._rest:
            self._more()
        size, _, self._rest = self._rest.partition(b":")
        while len(self._rest) < int(size):
            self._more()
        text, self._rest = self._rest[: int(size)], self._rest[int(size) :]
        return json.loads(text)

    def _more(self):
        more = self._socket.recv(1 << 16)
        assert more, "the browser has gone"
        self._rest += more

    @property
    def errors(self):
        """What the scripts of its pages have thrown."""
        self.call("Marionette:SetContext", value="chrome")
        found = self.call("WebDriver:ExecuteScript", script=ERRORS, args=[], sandbox="system")["value"]
        self.call("Marionette:SetContext", value="content")
        return found

    def open(self, address):
        """Go to an address."""
        self.call("WebDriver:Navigate", url=address)

    def value(self, expression):
        """What an expression of JavaScript gives; a promise is awaited."""
        script = "return window.eval(arguments[0])"  # which sees the constants of the page's scripts
        return self.call("WebDriver:ExecuteScript", script=script, args=[expression], sandbox=None)["value"]

    def key(self, name):
        """Press and release a key."""
        self._keys([KEYS.get(name, name)])

    def type(self, text):
        """Type a text, in place of what is selected."""
        self._keys(text)

    def _keys(self, keys):
        pressed = [{"type": kind, "value": key} for key in keys for kind in ("keyDown", "keyUp")]
        self.call("WebDriver:PerformActions", actions=[{"type": "key", "id": "keyboard", "actions": pressed}])

    def choose_file(self, selector, path):
        """Choose a file in a file field."""
        found = self.call("WebDriver:FindElement", using="css selector", value=selector)["value"]
        (element,) = found.values()
        self.call("WebDriver:ElementSendKeys", id=element, text=str(path))
