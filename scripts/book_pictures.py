#!/usr/bin/env python3
"""Makes the pictures of the book, docs/pictures, of what `lobestone demo` writes.

    python3 scripts/book_pictures.py [--program target/release/lobestone] [--browser chromium]

Figures are those of the demo's report as they are; `demo-page.png` is the top of its page in a browser. Only the standard library is
used.
"""

import argparse
import pathlib
import shutil
import subprocess
import tempfile

from check_report import Browser

ROOT = pathlib.Path(__file__).resolve().parent.parent
OUT = ROOT / "docs/pictures"
FIGURES = [
    "lobes-1", "misfit-milling", "modal-nyquist", "modal-reconstruction", "modal-stabilisation", "record-01", "regression-milling-force",
    "robot-postures", "second-error-map", "second-frf-worst-1", "second-history", "second-missing-candidates", "second-missing-frf-1",
]  # fmt: skip


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--program", type=pathlib.Path, default=ROOT / "target/release/lobestone")
    arguments.add_argument("--browser", default="chromium")
    options = arguments.parse_args()
    OUT.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([options.program.resolve(), "demo", "--quiet"], cwd=folder, check=True)
        report = pathlib.Path(folder) / "lobestone-demo/report"
        for name in FIGURES:
            shutil.copyfile(report / f"{name}.png", OUT / f"{name}.png")
        with Browser(options.browser, 120) as browser:
            browser.send("Page.navigate", url=(report / "report.html").as_uri())
            browser.wait_for("document.documentElement?.dataset.ready === 'true'")
            browser.shot(OUT / "demo-page.png", {"x": 0, "y": 0, "width": 1280, "height": 900})
    stale = {path.stem for path in OUT.glob("*.png")} - {*FIGURES, "demo-page"}
    for name in stale:
        (OUT / f"{name}.png").unlink()
    print(f"wrote {len(FIGURES) + 1} pictures, {sum(p.stat().st_size for p in OUT.glob('*.png')) // 1000} kB")


if __name__ == "__main__":
    main()
