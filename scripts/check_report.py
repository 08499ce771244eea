#!/usr/bin/env python3
"""Opens an interactive report in headless Chromium and uses it as a reader would.

    python3 scripts/check_report.py report.html [--shots FOLDER] [--browser chromium]

Fails where the page logs an error or loads anything, where a figure is empty, where a button for another model changes
neither curve nor stated error, where a cell of an error map does not lead to an FRF (mouse, keyboard), where poles cannot be picked by
keyboard, or where paper lacks the figures.
What was found is printed as JSON. Only the standard library is used; the browser is spoken to over its debugging pipe
(https://chromedevtools.github.io/devtools-protocol/).
"""

import argparse
import base64
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import threading
import time

FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--enable-unsafe-swiftshader",
    "--hide-scrollbars",
    # A desk with a mouse.
    "--blink-settings=primaryHoverType=2,availableHoverTypes=2,primaryPointerType=4,availablePointerTypes=4",
    "--window-size=1280,1000",
    "--remote-debugging-pipe",
]


class Browser:
    """A browser with one page, until the end of a `with` block."""

    def __init__(self, program, timeout_s):
        self.deadline = time.monotonic() + timeout_s
        self.profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        (read_commands, self.commands), (self.answers, write_answers) = os.pipe(), os.pipe()

        def as_3_and_4():
            # Out of the way first: either may be 3 or 4 itself.
            first, second = os.dup(read_commands), os.dup(write_answers)
            high = [os.dup2(fd, place) for fd, place in ((first, 60), (second, 61))]
            os.dup2(high[0], 3)
            os.dup2(high[1], 4)

        self.process = subprocess.Popen(
            [program, *FLAGS, f"--user-data-dir={self.profile.name}", "about:blank"],
            preexec_fn=as_3_and_4,
            close_fds=False,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(read_commands)
        os.close(write_answers)
        self.number, self.session, self.events, self.replies = 0, None, [], {}
        self.news = threading.Condition()
        threading.Thread(target=self.listen, daemon=True).start()
        pages = [t for t in self.send("Target.getTargets")["targetInfos"] if t["type"] == "page"]
        attached = self.send("Target.attachToTarget", targetId=pages[0]["targetId"], flatten=True)
        self.session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.send(f"{domain}.enable")

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.process.terminate()
        try:
            self.process.wait(10)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        self.profile.cleanup()

    def listen(self):
        rest = b""
        while True:
            try:
                chunk = os.read(self.answers, 1 << 20)
            except OSError:
                chunk = b""
            *messages, rest = (rest + chunk).split(b"\0")
            with self.news:
                for message in map(json.loads, messages):
                    if "id" in message:
                        self.replies[message["id"]] = message
                    else:
                        self.events.append(message)
                if not chunk:
                    self.replies = None
                self.news.notify_all()
            if not chunk:
                return

    def send(self, method, **params):
        self.number += 1
        message = {"id": self.number, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        data = json.dumps(message).encode() + b"\0"
        while data:
            data = data[os.write(self.commands, data) :]
        with self.news:
            while self.replies is not None and self.number not in self.replies:
                if not self.news.wait(self.deadline - time.monotonic()):
                    raise SystemExit(f"the browser does not answer {method}")
            if self.replies is None:
                raise SystemExit("the browser ended by itself")
            reply = self.replies.pop(self.number)
        if "error" in reply:
            raise SystemExit(f"{method}: {reply['error']['message']}")
        return reply["result"]

    def run(self, script):
        """The value of a JavaScript expression; promises are waited for."""
        result = self.send("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        if "exceptionDetails" in result:
            details = result["exceptionDetails"]
            raise SystemExit(f"{script}: {details.get('exception', {}).get('description', details['text'])}")
        return result["result"].get("value")

    def wait_for(self, script):
        while not self.run(script):
            if time.monotonic() > self.deadline:
                raise SystemExit(f"waited in vain for {script}; the page logged {self.complaints()}")
            time.sleep(0.1)

    def complaints(self):
        """Errors and exceptions of the page."""
        found = []
        for event in self.events:
            params = event.get("params", {})
            if event["method"] == "Runtime.exceptionThrown":
                details = params["exceptionDetails"]
                found.append(details.get("exception", {}).get("description", details["text"]))
            elif event["method"] == "Runtime.consoleAPICalled" and params["type"] in ("error", "assert"):
                found.append(" ".join(str(a.get("value", a.get("description"))) for a in params["args"]))
            elif event["method"] == "Page.javascriptDialogOpening":
                found.append(f"the page asks: {params['message']}")
            elif event["method"] == "Log.entryAdded" and params["entry"]["level"] == "error":
                found.append(params["entry"]["text"])
        return found

    def loaded(self):
        """What the page asked for besides itself and what it holds inside."""
        asked = [e["params"]["request"]["url"] for e in self.events if e["method"] == "Network.requestWillBeSent"]
        return [url for url in asked[1:] if not url.startswith(("data:", "blob:"))]

    def shot(self, path, clip=None):
        params = {"format": "png", "captureBeyondViewport": clip is not None}
        if clip:
            params["clip"] = {**clip, "scale": 1}
        path.write_bytes(base64.b64decode(self.send("Page.captureScreenshot", **params)["data"]))

    def element_shot(self, path, selector, number):
        box = self.run(
            f"(() => {{ const r = document.querySelectorAll({json.dumps(selector)})[{number}].getBoundingClientRect();"
            " return {x: r.x + scrollX, y: r.y + scrollY, width: r.width, height: r.height}; })()"
        )
        self.shot(path, box)


# The model's curve as it is drawn, and what is said of it.
MODEL = """(() => {
  const root = document.querySelector('.explorer');
  const trace = root.querySelector('.bode').data.find((t) => t.name.startsWith('model '));
  return { y: trace.y.slice(0, 400), name: trace.name, frf: root.dataset.frf,
    stated: root.querySelector('.stated').textContent };
})()"""

# Figures whose drawing is missing, empty, or reaches out of the figure.
FAULTS = """[...document.querySelectorAll('.js-plotly-plot')].flatMap((div) => {
  const faults = [];
  const box = div.getBoundingClientRect();
  const name = div.closest('[data-plot]')?.querySelector('.heading')?.textContent ?? div.className;
  if (box.width < 300 || box.height < 150) faults.push(`${name}: ${box.width} × ${box.height}`);
  const drawn = div.querySelectorAll('.trace, .heatmaplayer image, .gl-container canvas').length;
  if (drawn === 0) faults.push(`${name}: nothing drawn`);
  for (const text of div.querySelectorAll('.xtitle, .ytitle, .legendtext, .xtick text, .ytick text')) {
    const t = text.getBoundingClientRect();
    if (t.width > 0 && (t.left < box.left - 2 || t.right > box.right + 2 || t.bottom > box.bottom + 2 || t.top < box.top - 2)) {
      faults.push(`${name}: "${text.textContent}" is cut off`);
    }
  }
  return faults;
})"""


# From top to bottom, at each stop until what is in the window is drawn.
THROUGH = """(async () => {
  const inWindow = ({ top, bottom, height }) => height > 0 && top < innerHeight && bottom > 0;
  const blank = (div) => !div.matches('.js-plotly-plot') && inWindow(div.getBoundingClientRect());
  for (let top = 0; top < document.documentElement.scrollHeight; top += 0.8 * innerHeight) {
    scrollTo({ top, behavior: 'instant' });
    for (let k = 0; k < 200 && [...document.querySelectorAll('.plot')].some(blank); k++) await new Promise((done) => setTimeout(done, 50));
  }
  scrollTo({ top: 0, behavior: 'instant' });
})()"""


def check(condition, what):
    if not condition:
        raise SystemExit(f"the report fails: {what}")


def use(browser, page, shots):
    browser.send("Page.navigate", url=page.resolve().as_uri())
    browser.wait_for("document.documentElement?.dataset.ready === 'true'")
    # What is folded up is drawn when it is opened, and what is further down when the reader comes near.
    browser.run("document.querySelectorAll('details').forEach((fold) => { fold.open = true; })")
    browser.run(THROUGH)
    browser.wait_for("document.querySelectorAll('.js-plotly-plot').length === document.querySelectorAll('.plot').length")
    browser.wait_for("document.documentElement?.dataset.ready === 'true'")
    found = {
        "figures": browser.run("document.querySelectorAll('.js-plotly-plot').length"),
        "images": browser.run("document.images.length"),
        "models": browser.run("document.querySelectorAll('.explorer .models button').length"),
    }
    planned = browser.run("document.querySelectorAll('.plot').length")
    check(found["figures"] == planned > 0, f"{found['figures']} of {planned} figures are drawn")
    faults = browser.run(FAULTS)
    check(not faults, "; ".join(faults))
    visible = "(e) => e.getBoundingClientRect().height > 0"
    both = browser.run(f"[...document.querySelectorAll('[data-plot] img')].filter({visible}).length")
    check(both == 0, f"{both} images stand next to the figures that replace them")
    if shots:
        browser.shot(shots / "top.png")
        for kind, selector in (("explorer", ".explorer"), ("figure", "[data-plot]")):
            for k in range(browser.run(f"document.querySelectorAll('{selector}').length")):
                browser.element_shot(shots / f"{kind}-{k:02}.png", selector, k)
    if found["models"]:
        found |= use_explorer(browser, shots)
    if browser.run("document.querySelector('.picker') !== null"):
        found["picked"] = pick(browser)
    complaints, loaded = browser.complaints(), browser.loaded()
    check(not complaints, f"the page logged {complaints}")
    check(not loaded, f"the page loaded {loaded}")
    found["pages_on_paper"] = on_paper(browser, shots)
    return found


def use_explorer(browser, shots):
    click = "document.querySelectorAll('.explorer .models')[0].children[{}].click()"
    settled = "new Promise((done) => setTimeout(done, 400))"
    # Every model has its own curve and its own error.
    seen = []
    count = browser.run("document.querySelector('.explorer .models').children.length")
    for model in range(count):
        browser.run(click.format(model))
        browser.run(settled)
        seen.append(browser.run(MODEL))
    for before, after in zip(seen, seen[1:]):
        check(before["y"] != after["y"], f"the curve stays the same from {before['name']} to {after['name']}")
        check(before["stated"] != after["stated"], f"what is said stays the same: {after['stated']}")
    errors = [float(re.search(r"All FRFs together: error ([\d.]+)", s["stated"])[1]) for s in seen]
    # A cell of an error map leads to its FRF; the one of another FRF than the present.
    target = browser.run(
        """(() => {
          const figure = [...document.querySelectorAll('[data-plot]')].find((f) => f.querySelector('.models'));
          if (!figure) return null;
          const div = figure.querySelector('.plot');
          div.scrollIntoView({ block: 'center', behavior: 'instant' });
          const box = div.getBoundingClientRect();
          const { _offset: left, _length: wide } = div._fullLayout.xaxis;
          const { _offset: top, _length: high } = div._fullLayout.yaxis;
          const [rows, columns] = [div.data[0].z.length, div.data[0].z[0].length];
          // In the middle of the window, whatever the height of the map.
          const row = Math.floor(rows / 2);
          return { x: box.x + left + wide * 0.5 / columns, y: box.y + top + high * (row + 0.5) / rows,
            map: div.data[0].z[0].slice() };
        })()"""
    )
    check(target, "there is no map of the error")
    before = browser.run(MODEL)
    for kind in ("mouseMoved", "mousePressed", "mouseReleased"):
        button = {"button": "left", "clickCount": 1} if kind != "mouseMoved" else {}
        browser.send("Input.dispatchMouseEvent", type=kind, x=target["x"], y=target["y"], **button)
        time.sleep(0.15)
    browser.run("new Promise((done) => setTimeout(done, 1500))")
    after = browser.run(MODEL)
    check(after["frf"] != before["frf"] and after["y"] != before["y"], "a click on a cell of the error map shows no other FRF")
    # The same without a mouse: arrow keys choose a cell, which is told, and Enter leads to the FRF.
    browser.run("document.querySelector('[data-plot]:has(.models) .plot').focus()")
    press(browser, "ArrowDown", "ArrowRight", "Enter")
    told = browser.run("document.querySelector('[data-plot]:has(.models) .told').textContent")
    check(": " in told, f"arrow keys choose no cell of the error map: {told!r}")
    check(browser.run("document.activeElement.name") == "posture", "Enter on a cell of the error map leads nowhere")
    browser.run("new Promise((done) => setTimeout(done, 1000))")
    if shots:
        browser.shot(shots / "after-click.png")
        browser.run(click.format(0))
        browser.run(settled)
        browser.element_shot(shots / "first-model.png", ".explorer", 0)
        map_figure = "[data-plot]:has(.models)"
        browser.element_shot(shots / "first-model-map.png", map_figure, 0)
    else:
        browser.run(click.format(0))
        browser.run(settled)
    recoloured = browser.run("document.querySelector('[data-plot]:has(.models) .plot').data[0].z[0]")
    check(count == 1 or recoloured != target["map"], "the error map does not follow the model")
    # Choosing a posture by its list.
    other = browser.run(
        """(async () => {
          const root = document.querySelector('.explorer');
          const select = root.querySelector('select[name=posture]');
          const other = [...select.options].find((o) => !o.selected);
          if (!other) return null;
          select.value = other.value;
          select.dispatchEvent(new Event('change'));
          await new Promise((done) => setTimeout(done, 400));
          return [other.value, root.querySelector('.stated').textContent];
        })()"""
    )
    check(other is None or other[1].startswith(f"Posture {other[0]},"), f"the list of postures does not choose: {other}")
    return {"errors_percent": errors, "frf_after_click": int(after["frf"])}


def press(browser, *keys):
    for key in keys:
        for kind in ("rawKeyDown", "keyUp"):
            browser.send("Input.dispatchKeyEvent", type=kind, key=key, code=key)


def pick(browser):
    """Two poles of the first stabilisation diagram, picked by keyboard, one of them put back."""
    browser.run("document.querySelector('.picker').focus()")
    picked = "document.querySelector('.picked').textContent"
    press(browser, "ArrowRight", "Enter", "ArrowLeft", "Enter")
    both = browser.run(picked)
    press(browser, "Enter")
    one = browser.run(picked)
    check((both.count("--pole"), one.count("--pole")) == (2, 1), f"poles picked by keyboard: {both!r}, then {one!r}")
    told = browser.run("document.querySelector('.pointed').textContent")
    check(" Hz, " in told and told.endswith("not picked"), f"the pole is not told: {told!r}")
    return one


def on_paper(browser, shots):
    """Number of printed pages; paper shows every image and no figure for the mouse."""
    browser.send("Emulation.setEmulatedMedia", media="print")
    hidden = browser.run("[...document.images].filter((e) => e.getBoundingClientRect().height < 20).length")
    plots = browser.run(
        "[...document.querySelectorAll('.plot, .explorer')].filter((e) => e.getBoundingClientRect().height > 0).length"
    )
    check(hidden == 0 and plots == 0, f"on paper {hidden} images are missing and {plots} interactive figures stand")
    browser.send("Emulation.setEmulatedMedia", media="")
    pdf = base64.b64decode(browser.send("Page.printToPDF", printBackground=True, preferCSSPageSize=True)["data"])
    if shots:
        (shots / "print.pdf").write_bytes(pdf)
    pages = len(re.findall(rb"/Type\s*/Page\b", pdf))
    check(pages > 0, "nothing is printed")
    return pages


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("page", type=pathlib.Path)
    parser.add_argument("--shots", type=pathlib.Path, help="folder for screenshots and the printed page")
    parser.add_argument("--browser", default=next(filter(None, map(shutil.which, ("chromium", "chromium-browser"))), None))
    parser.add_argument("--timeout", type=float, default=240.0, help="seconds for all of it")
    args = parser.parse_args()
    if not args.browser:
        raise SystemExit("no chromium found; install it or name it with --browser")
    if args.shots:
        args.shots.mkdir(parents=True, exist_ok=True)
    with Browser(args.browser, args.timeout) as browser:
        json.dump(use(browser, args.page, args.shots), sys.stdout)
    print()


if __name__ == "__main__":
    main()
