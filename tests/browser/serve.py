"""Drives the page of `lobestone serve` in headless Chromium: diagnose, add, undo, twice at once, from the keyboard.

    python3 tests/browser/serve.py URL [FOLDER FOR SCREENSHOTS]

Needs chromium and chromedriver (Debian: chromium, chromium-driver) and nothing else. The campaign served must lack
exactly the effect EFFECT. Ends with status 0 and a line of JSON; 77 where there is no browser; 1 with what went wrong.
"""

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

EFFECT = "tool-flexibility"
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


IDLE = """return document.getElementById('job').hidden
    && document.querySelector('[data-key=structure-diagnose]')?.getAttribute('aria-disabled') === 'false'"""
FOLD = "document.querySelector('#modes details')"
ERROR = "return document.querySelector('.big .now')?.innerText"
ROWS = "return document.querySelectorAll('.errors tbody tr').length"


def in_report(driver, script):
    """What the script gives within the report's frame, as soon as it gives anything."""
    frame = driver.call("POST", "/element", {"using": "css selector", "value": "#frame"})
    driver.call("POST", "/frame", {"id": frame})
    value = driver.until("the report: " + script, script)
    driver.call("POST", "/frame", {"id": None})
    return value


def percent(text):
    return float(text.removesuffix(" %"))


def story(driver, url, pictures):
    told = {}
    driver.call("POST", "/url", {"url": url})
    # By itself it reads the campaign, fits the model and draws the report.
    driver.until("the report", "return !document.getElementById('frame').hidden")
    driver.until("the end of the first job", IDLE)
    before = driver.until("the error", ERROR)
    told["before"] = before
    driver.picture(pictures, "1-opened")

    driver.click("[data-key=structure-diagnose]")
    told["progress"] = driver.until("progress", """const part = document.getElementById('job-stage').textContent;
        return /\\d+ of \\d+/.test(part) && part""")
    driver.picture(pictures, "2-diagnosing")
    # Impatience: a second click, and one in another window (as its own request), while the first is worked on.
    driver.run("document.querySelector('[data-key=structure-diagnose]').click()")
    refused = driver.run("""const token = document.querySelector('meta[name=token]').content;
        return fetch('order', {method: 'POST', headers: {'X-Lobestone-Token': token},
            body: '{"do": "diagnose", "side": "structure"}'}).then(async (r) => [r.status, await r.text()])""")
    told["refused"] = refused[1]
    if refused[0] != 409 or "diagnosis is still running" not in refused[1]:
        raise Failed(f"a second order while one is worked on: {refused}")
    verdict = driver.until("the verdict", "return document.querySelector('.verdict .answer')?.innerText")
    told["verdict"] = verdict
    if EFFECT not in verdict or "confidence" not in verdict:
        raise Failed(f"the verdict is: {verdict}")
    driver.until("the end of the diagnosis", IDLE)
    in_report(driver, "return document.body.innerText.includes('Which physics is missing')")
    driver.picture(pictures, "3-diagnosed")
    # The reader goes down to a part that is folded up and unfolds it.
    in_report(driver, f"""const fold = {FOLD};
        fold.open = true;
        scrollBy(0, fold.getBoundingClientRect().top);
        return scrollY > 300""")
    time.sleep(0.5)

    driver.click(f"[data-key='structure-{EFFECT}-explained'] summary")
    driver.click(f"[data-key='structure-add-{EFFECT}']")
    driver.until("a second bar", ROWS + " === 2")
    driver.until("the end of adding", IDLE)
    after = driver.run(ERROR)
    told["after"] = after
    if not percent(after) < 0.2 * percent(before):
        raise Failed(f"the error did not fall: {before} -> {after}")
    drawn = driver.run("return document.getElementById('frame').src")
    driver.picture(pictures, "4-added")

    # The report in its frame is that of the new revision, and cannot reach the page around it.
    in_report(driver, f"return document.body.innerText.includes('1 + {EFFECT}')")
    # Its reader is where the reader was.
    in_report(driver, "return document.documentElement.dataset.ready === 'true'")
    there = in_report(driver, f"return [{FOLD}.open, {FOLD}.getBoundingClientRect().top]")
    if not there[0] or abs(there[1]) > 50:
        raise Failed(f"the reader had unfolded what was at the top, and after adding it is unfolded and at: {there}")
    driver.picture(pictures, "4-where-the-reader-was")
    inside = in_report(driver, "try { return parent.document.title } catch (e) { return e.name }")
    if inside != "SecurityError":
        raise Failed(f"the report reaches the page around it: {inside}")

    # Undo without a mouse.
    driver.run("document.querySelector('[data-key=structure-diagnose]').focus()")
    driver.keys("\ue004", "\ue007")
    driver.until("the last revision's end", ROWS + " === 1")
    driver.until("the end of the undo", IDLE)
    back = driver.run(ERROR)
    told["back"] = back
    if abs(percent(back) - percent(before)) > 0.2:
        raise Failed(f"undone, but the error is {back} and was {before}")
    if driver.run("return document.getElementById('frame').src") == drawn:
        raise Failed("the report was not drawn again")
    # The verdict of before holds again.
    if driver.run("return document.querySelector('.verdict .answer')?.innerText") != verdict:
        raise Failed("the diagnosis of the baseline is not shown again")
    driver.picture(pictures, "5-undone")

    # A click on what is shown is refused where the model was changed elsewhere meanwhile.
    refused = driver.run("""const token = document.querySelector('meta[name=token]').content;
        return fetch('order', {method: 'POST', headers: {'X-Lobestone-Token': token},
            body: '{"do": "undo", "side": "structure", "head": "1-0"}'}).then(async (r) => [r.status, await r.text()])""")
    if refused[0] != 409 or "changed since" not in refused[1]:
        raise Failed(f"an order from an old page: {refused}")

    driver.call("POST", "/window/rect", {"width": 560, "height": 1000})
    if driver.run("return document.documentElement.scrollWidth > innerWidth"):
        raise Failed("a narrow window scrolls sideways")
    driver.picture(pictures, "6-narrow")
    return told


def complaints(driver, url):
    """Errors in the console (but for the refusals that were asked for), and requests to anybody else."""
    wrong = []
    for entry in driver.call("POST", "/se/log", {"type": "browser"}):
        if entry["level"] in ("SEVERE", "WARNING") and "409" not in entry["message"]:
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


def main():
    url = sys.argv[1]
    pictures = pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else None
    if pictures:
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
            wrong = complaints(driver, url)
            if wrong:
                raise Failed("the browser complains:\n" + "\n".join(wrong))
            print(json.dumps(told, ensure_ascii=False))
            return 0
        except Failed as failed:
            if driver:
                driver.picture(pictures, "failed")
            print(failed, file=sys.stderr)
            return 1
        finally:
            if driver:
                try:
                    driver.call("DELETE", "")
                except (Failed, OSError):
                    pass
            process.terminate()
            process.wait(10)


if __name__ == "__main__":
    sys.exit(main())
