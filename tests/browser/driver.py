"""Headless Chromium for the stories of this folder: needs chromium and chromedriver (Debian: chromium, chromium-driver) and nothing else."""

import base64
import json
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

# A diagnosis on a busy machine.
PATIENCE_S = 240.0
ELEMENT = "element-6066-11e4-a52e-4f735466cecf"


class Failed(Exception):
    pass


class Driver:
    """The few commands of WebDriver (W3C) that are needed here."""

    def __init__(self, port, profile):
        self.base = f"http://127.0.0.1:{port}"
        flags = ["--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
                 "--disable-background-networking", "--disable-dev-shm-usage", "--window-size=1500,1000",
                 f"--user-data-dir={profile}"]
        patience_ms = int(1000 * PATIENCE_S)
        options = {"browserName": "chrome", "goog:chromeOptions": {"args": flags},
                   "timeouts": {"script": patience_ms, "pageLoad": patience_ms},
                   "goog:loggingPrefs": {"browser": "ALL", "performance": "ALL"}}
        self.session = ""
        answer = self.call("POST", "/session", {"capabilities": {"alwaysMatch": options}})
        self.session = f"/session/{answer['sessionId']}"

    def call(self, method, path, body=None):
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.base + self.session + path, data, {"Content-Type": "application/json"},
                                         method=method)
        try:
            with urllib.request.urlopen(request, timeout=PATIENCE_S) as answer:
                return json.load(answer)["value"]
        except urllib.error.HTTPError as error:
            raise Failed(f"{method} {path}: {json.load(error)['value']['message']}") from error

    def run(self, script, *arguments):
        return self.call("POST", "/execute/sync", {"script": script, "args": list(arguments)})

    def until(self, what, script, *arguments):
        end = time.monotonic() + PATIENCE_S
        while time.monotonic() < end:
            value = self.run(script, *arguments)
            if value:
                return value
            time.sleep(0.1)
        raise Failed(f"waited in vain for {what}; the page says: {self.run('return document.body.innerText')}")

    def click(self, selector):
        element = self.call("POST", "/element", {"using": "css selector", "value": selector})[ELEMENT]
        self.call("POST", f"/element/{element}/click", {})

    def keys(self, *keys):
        actions = [{"type": kind, "value": key} for key in keys for kind in ("keyDown", "keyUp")]
        self.call("POST", "/actions", {"actions": [{"type": "key", "id": "keyboard", "actions": actions}]})

    def picture(self, folder, name):
        if folder:
            png = base64.b64decode(self.call("GET", "/screenshot"))
            (folder / f"{name}.png").write_bytes(png)


def complaints(driver, url, refused):
    """Errors in the console (but for the refusals that were asked for, by their status), and requests to anybody else."""
    wrong = []
    for entry in driver.call("POST", "/se/log", {"type": "browser"}):
        if entry["level"] in ("SEVERE", "WARNING") and refused not in entry["message"]:
            wrong.append(entry["message"])
    for entry in driver.call("POST", "/se/log", {"type": "performance"}):
        message = json.loads(entry["message"])["message"]
        if message["method"] == "Network.requestWillBeSent":
            asked = message["params"]["request"]["url"]
            # The browser's own first page, before ours (chrome://, chrome-untrusted://).
            its_own = message["params"].get("documentURL", "").startswith("chrome")
            if not its_own and not asked.startswith((url.rsplit('/', 2)[0], "data:", "blob:")):
                wrong.append(f"asked for {asked}")
    return wrong


def free_port():
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def tell(story, url, pictures, refused, failed="failed"):
    """Prints what `story(driver, url, pictures)` tells, as JSON. The status to end with: 0; 77 where there is no browser; 1 with what went
    wrong. `pictures`: path of the folder for them, or None; the last one is called `failed` where something went wrong. `refused`: status of
    the answers that the story asks for and that are no fault."""
    if pictures:
        pictures = pathlib.Path(pictures)
        pictures.mkdir(parents=True, exist_ok=True)
    chromedriver = shutil.which("chromedriver")
    if not chromedriver or not (shutil.which("chromium") or shutil.which("google-chrome")):
        print("skipped: no chromium and chromedriver here")
        return 77
    port = free_port()
    with tempfile.TemporaryDirectory() as profile:
        process = subprocess.Popen([chromedriver, f"--port={port}"], stdout=subprocess.DEVNULL,
                                   stderr=subprocess.DEVNULL)
        driver = None
        try:
            for _ in range(100):
                try:
                    urllib.request.urlopen(f"http://127.0.0.1:{port}/status", timeout=5).close()
                    break
                except OSError:
                    time.sleep(0.1)
            driver = Driver(port, profile)
            told = story(driver, url, pictures)
            wrong = complaints(driver, url, refused)
            if wrong:
                raise Failed("the browser complains:\n" + "\n".join(wrong))
            print(json.dumps(told, ensure_ascii=False))
            return 0
        except Failed as reason:
            if driver:
                driver.picture(pictures, failed)
            print(reason, file=sys.stderr)
            return 1
        finally:
            if driver:
                try:
                    driver.call("DELETE", "")
                except (Failed, OSError):
                    pass
            process.terminate()
            process.wait(10)
