"""Drives the beginning of the page of `lobestone serve` in headless Chromium: started without a folder, a folder typed, one dropped
on the page, its list of cuts edited in place, reading files cancelled.

    python3 tests/browser/begin.py LOBESTONE [FOLDER FOR SCREENSHOTS]

Ends with status 0 and a line of JSON; 77 where there is no browser; 1 with what went wrong.
"""

import json
import pathlib
import shutil
import subprocess
import sys
import tempfile

from driver import Failed, tell

RECORDS = pathlib.Path(__file__).parents[1] / "data/blind/force-9400/force"
# As a German spreadsheet saves it.
LIST = "Datei;Drehzahl [1/min];ap [mm]\ncut01.txt;1160;2,0\ncut04.txt;1620;2,0\ncut05.txt;1160;2,5\n"
# Enough that reading them takes a while.
MANY = 400
SPEED = "[...document.querySelectorAll('[data-key$=\".spindle_rpm\"]')].filter((f) => !f.dataset.key.startsWith('all.'))"


def go(driver, folder):
    driver.run("document.getElementById('path').value = arguments[0]", str(folder))
    driver.click("#go")


def dropped(driver, folder):
    """As by a mouse, which no script of the page can do."""
    at = driver.run("const r = document.getElementById('drop').getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]")
    for kind in ("dragEnter", "dragOver", "drop"):
        data = {"items": [], "files": [str(folder)], "dragOperationsMask": 1}
        params = {"type": kind, "x": at[0], "y": at[1], "data": data}
        driver.call("POST", "/goog/cdp/execute", {"cmd": "Input.dispatchDragEvent", "params": params})


def story(driver, url, here, pictures):
    driver.call("POST", "/url", {"url": url})
    driver.until("the choice of a folder", "return !!document.getElementById('path')")
    go(driver, here / "nowhere")
    driver.until("a word on a folder that is not there", "return document.getElementById('begin-alert').textContent.includes('no such folder')")

    # Many files are read; that is ended, and nothing was written.
    go(driver, here / "many")
    driver.until("the folder", f"return document.body.innerText.includes('{MANY} files lie directly in it')")
    driver.click("#use")
    driver.until("progress", f"return /\\d+ of {MANY}/.test(document.querySelector('#reading p')?.textContent ?? '')")
    driver.picture(pictures, "begin-1-reading")
    driver.click("#read-cancel")
    driver.until("the folders again", """return !!document.getElementById('use')
        && document.getElementById('begin-alert').textContent.includes('nothing was written')""")
    if (here / "many/campaign.toml").exists():
        raise Failed("cancelled, and a campaign was written")

    # A folder is dropped and copied.
    go(driver, here / "copies")
    driver.until("the other place", "return document.getElementById('path')?.value.endsWith('copies')")
    dropped(driver, here / "cell 7")
    driver.until("what was dropped", "return document.getElementById('copy').innerText.includes('4 files')")
    name = driver.run("return document.getElementById('new-name').value")
    if name != "cell 7":
        raise Failed(f"the new folder is called {name}")
    driver.picture(pictures, "begin-2-dropped")
    driver.click("#copy-files")
    values = driver.until("the list of cuts", f"const f = {SPEED}; return f.length && f.map((x) => x.value)")
    if [float(v) for v in values] != [1160.0, 1620.0, 1160.0]:
        raise Failed(f"the list of cuts says 1160, 1620, 1160, the table {values}")

    # A cell is corrected where it stands; page and focus stay where they are.
    driver.run(f"const f = {SPEED}[1]; f.scrollIntoView({{ block: 'center' }}); f.focus(); f.select()")
    before = driver.run("return [scrollY, document.activeElement.dataset.key]")
    driver.keys(*"1750", "\ue004")
    driver.until("the corrected speed in the file", "return document.querySelector('[data-key=toml] pre').textContent.includes('1750')")
    after = driver.run(f"return [scrollY, {SPEED}[1].dataset.key, {SPEED}[1].value]")
    if abs(after[0] - before[0]) > 2 or after[1] != before[1] or float(after[2]) != 1750.0:
        raise Failed(f"a cell was edited: {before} -> {after}")
    if "1620" in driver.run("return document.querySelector('[data-key=toml] pre').textContent"):
        raise Failed("the old speed is still in the file")
    driver.picture(pictures, "begin-3-edited")
    return {"edited": after}


def main():
    with tempfile.TemporaryDirectory() as folder:
        here = pathlib.Path(folder).resolve()
        for name in ("many", "cell 7", "copies"):
            (here / name).mkdir()
        for name in ("cut01.txt", "cut04.txt", "cut05.txt"):
            shutil.copy(RECORDS / name, here / "cell 7" / name)
        (here / "cell 7/Versuche.csv").write_text(LIST)
        for i in range(MANY):
            shutil.copy(RECORDS / "cut01.txt", here / "many" / f"cut{i:03}.txt")
        served = subprocess.Popen([sys.argv[1], "serve", "--port", "0", "--json"], cwd=here, stdout=subprocess.PIPE,
                                  stderr=subprocess.DEVNULL)
        try:
            url = json.loads(served.stdout.readline())["url"]
            pictures = sys.argv[2] if len(sys.argv) > 2 else None
            return tell(lambda driver, url, pictures: story(driver, url, here, pictures), url, pictures, refused="422",
                        failed="begin-failed")
        finally:
            served.terminate()
            served.wait(10)


if __name__ == "__main__":
    sys.exit(main())
