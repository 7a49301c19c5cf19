"""A real Chromium without a display, driven over pipes by its DevTools protocol: no driver, no port, no package."""

import base64
import json
import os
import shutil
import subprocess
import tempfile
import time

WAIT = 60.0  # s, for anything that a page is asked, on a loaded machine


def find_chromium():
    """Return the program, or None where there is none."""
    return next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)


class Chromium:
    """One page of a headless browser; `complaints` are what its console and its scripts reported as wrong."""

    def __enter__(self):
        self.folder = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        to_browser, self._to = os.pipe()
        self._from, from_browser = os.pipe()
        command = [
            find_chromium(),
            *("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run"),
            *(f"--user-data-dir={self.folder.name}", "--remote-debugging-pipe", "about:blank"),
        ]
        # The browser reads its descriptor 3 and writes its descriptor 4.
        shell = f'exec "$@" 3<&{to_browser} 4>&{from_browser}'
        self._process = subprocess.Popen(
            ["bash", "-c", shell, "bash", *command],
            pass_fds=(to_browser, from_browser),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(to_browser)
        os.close(from_browser)
        os.set_blocking(self._from, False)
        self._rest, self._number, self._session, self.complaints, self._events = b"", 0, None, [], []
        targets = self.call("Target.getTargets")["targetInfos"]
        page = next(target["targetId"] for target in targets if target["type"] == "page")
        self._session = self.call("Target.attachToTarget", targetId=page, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")
        return self

    def __exit__(self, *_):
        self._process.kill()
        self._process.wait()
        os.close(self._to)
        os.close(self._from)
        self.folder.cleanup()

    def call(self, method, **parameters):
        """Call a method of the protocol and return its result."""
        self._number += 1
        message = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            message["sessionId"] = self._session
        os.write(self._to, json.dumps(message).encode() + b"\0")
        answer = self._wait_for(lambda one: one.get("id") == self._number)
        assert "error" not in answer, answer["error"]
        return answer["result"]

    def open(self, path):
        """Open a file and wait until the view in it has been unpacked."""
        self.call("Page.navigate", url=f"file://{path}")
        self.wait_until(
            "document.readyState === 'complete' && (!document.getElementById('play-canvas')"
            " || document.getElementById('play-canvas').dataset.ready === 'yes')"
        )

    def evaluate(self, expression):
        """Return the value of an expression in the page."""
        result = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def wait_until(self, expression):
        """Wait until an expression in the page is true."""
        end = time.monotonic() + WAIT
        while not self.evaluate(expression):
            assert time.monotonic() < end, f"in {WAIT:g} s it never became true: {expression}; {self.complaints}"
            time.sleep(0.02)

    def press(self, key):
        """Press and release a key where the page's focus is."""
        text = {"text": key} if len(key) == 1 else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", key=key, **text)
        self.call("Input.dispatchKeyEvent", type="keyUp", key=key)

    def drag(self, start, end):
        """Drag with the left button from a place to another [px]."""
        for kind, (x, y) in (("mousePressed", start), ("mouseMoved", end), ("mouseReleased", end)):
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def pinch(self, *places):
        """Put two fingers on two places [px], and move the second ones half as far away again."""
        (x1, y1), (x2, y2) = places
        for kind, share in (("touchStart", 1.0), ("touchMove", 1.2), ("touchMove", 1.5)):
            points = [{"x": x1, "y": y1, "id": 0}, {"x": x1 + share * (x2 - x1), "y": y1 + share * (y2 - y1), "id": 1}]
            self.call("Input.dispatchTouchEvent", type=kind, touchPoints=points)
        self.call("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])

    def screenshot(self):
        """Return a picture of what is seen, as the bytes of a PNG file."""
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def _wait_for(self, is_wanted):
        end = time.monotonic() + WAIT
        while True:
            while b"\0" in self._rest:
                text, self._rest = self._rest.split(b"\0", 1)
                message = json.loads(text)
                self._note(message)
                if is_wanted(message):
                    return message
            assert time.monotonic() < end, "the browser does not answer"
            assert self._process.poll() is None, "the browser has ended"
            try:
                self._rest += os.read(self._from, 1 << 20)
            except BlockingIOError:
                time.sleep(0.005)

    def _note(self, message):
        told = message.get("params", {})
        if message.get("method") == "Runtime.exceptionThrown":
            self.complaints.append(told["exceptionDetails"]["exception"].get("description", "an exception"))
        if message.get("method") == "Runtime.consoleAPICalled" and told["type"] in ("error", "warning", "assert"):
            self.complaints.append(str(told["args"]))
        if message.get("method") == "Log.entryAdded":
            self.complaints.append(told["entry"]["text"])
        if message.get("method") == "Network.requestWillBeSent":
            address = told["request"]["url"]
            if address != told["documentURL"] and not address.startswith("data:"):
                self.complaints.append(f"asks for {address}")
