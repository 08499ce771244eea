"""Drives the page of `lobestone serve` in headless Chromium: diagnose, add, undo, twice at once, from the keyboard.

    python3 tests/browser/serve.py URL [FOLDER FOR SCREENSHOTS]

Needs chromium and chromedriver (Debian: chromium, chromium-driver) and nothing else. The campaign served must lack
exactly the effect EFFECT. Ends with status 0 and a line of JSON; 77 where there is no browser; 1 with what went wrong.
"""

import sys
import time

from driver import Failed, tell

EFFECT = "tool-flexibility"
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
    # Who has buttons is told to press them, not what to type.
    in_report(driver, f"return document.body.innerText.includes('press Add beside {EFFECT}')")
    typed = in_report(driver, "return [[...document.querySelectorAll('code.command')].map((code) => code.textContent)]")[0]
    if typed:
        raise Failed(f"the report in its frame says what to type: {typed}")
    driver.picture(pictures, "3-diagnosed")
    # The reader goes down to a part that is folded up and unfolds it.
    in_report(driver, f"""const fold = {FOLD};
        fold.open = true;
        scrollBy({{ top: fold.getBoundingClientRect().top, behavior: 'instant' }});
        return scrollY > 300""")
    # All that the diagnosis changed is drawn.
    in_report(driver, "return document.documentElement.dataset.ready === 'true'")
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
    time.sleep(0.5)
    there = in_report(driver, f"return [{FOLD}.open, {FOLD}.getBoundingClientRect().top]")
    if not there[0] or abs(there[1]) > 5:
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


if __name__ == "__main__":
    sys.exit(tell(story, sys.argv[1], sys.argv[2] if len(sys.argv) > 2 else None, refused="409"))
