"""The Windows program, run: under Wine here, as it is on Windows.

    python3 scripts/windows/check.py [--quick] [--program lobestone.exe] [--reference target/release/lobestone]

Without --program it is built first for x86_64-pc-windows-gnu (rustup target add x86_64-pc-windows-gnu; Debian: gcc-mingw-w64-x86-64-win32,
wine64); --quick without Parquet and little optimised. Runs `demo`, `diagnose`, `calibrate`, `export`, `batch` and `serve` on a folder with a
blank and an umlaut in its path and files with the line ends of Windows. Fails unless the verdict is the true one, the numbers are those
of --reference (where it is given) to 6 digits, the page of `serve` works, and no escape sequence goes to a file. Python 3.10 or newer.
"""

import argparse
import html
import json
import math
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
BLIND = ROOT / "tests/data/blind"
TARGET = "x86_64-pc-windows-gnu"
ON_WINDOWS = os.name == "nt"


def need(holds, what):
    if not holds:
        sys.exit(f"FAILED: {what}")


def wine_here():
    """What starts a Windows program here."""
    if ON_WINDOWS:
        return []
    # Debian keeps it off the path where only wine64 is installed.
    found = shutil.which("wine64") or shutil.which("wine") or shutil.which("wine64", path="/usr/lib/wine")
    need(found, "no Wine here: apt-get install wine64")
    return [found]


def prepared(environment, wine):
    """A folder of Wine's own, with the one library that Wine 8 lacks."""
    subprocess.run([wine, "cmd.exe", "/c", "exit"], env=environment, check=True, capture_output=True, timeout=300)
    system = Path(environment["WINEPREFIX"]) / "drive_c/windows/system32"
    need(system.is_dir(), f"Wine has not made {system}")
    library = system / "bcryptprimitives.dll"
    if not library.exists():
        compiler = "x86_64-w64-mingw32-gcc"
        need(shutil.which(compiler), f"no {compiler} here: apt-get install gcc-mingw-w64-x86-64-win32")
        source = ROOT / "scripts/windows/bcryptprimitives.c"
        subprocess.run([compiler, "-shared", "-O1", "-o", str(library), str(source), "-ladvapi32"], check=True)


def built(quick):
    folder = Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
    command = ["cargo", "build", "--release", "--locked", "--target", TARGET]
    environment = dict(os.environ)
    if quick:
        command += ["--no-default-features", "--features", "program"]
        environment.update(CARGO_PROFILE_RELEASE_OPT_LEVEL="1", CARGO_PROFILE_RELEASE_CODEGEN_UNITS="64")
    subprocess.run(command, check=True, cwd=ROOT, env=environment)
    return folder / TARGET / "release/lobestone.exe"


class Program:
    """The program under test, and the one whose numbers it is to give."""

    def __init__(self, command, environment):
        self.command, self.environment = command, environment

    def run(self, *arguments, **options):
        options = {"capture_output": True, "timeout": 600, "env": self.environment, **options}
        return subprocess.run([*self.command, *map(str, arguments)], **options)

    def text(self, *arguments, **options):
        done = self.run(*arguments, **options)
        out, err = done.stdout.decode(), done.stderr.decode(errors="replace")
        need(done.returncode == 0, f"{arguments}: status {done.returncode}\n{out[-2000:]}\n{err[-2000:]}")
        need("\x1b" not in out + err, f"{arguments}: escape sequences though no terminal reads them")
        return out

    def document(self, *arguments, **options):
        return json.loads(self.text(*arguments, "--json", **options))


def same(here, there, at=""):
    """Where two documents differ: texts of paths and times aside, numbers to 6 digits."""
    if isinstance(here, dict) and isinstance(there, dict):
        need(here.keys() == there.keys(), f"{at}: keys {sorted(here.keys() ^ there.keys())}")
        for key in here:
            if key not in ("next_step", "seconds"):
                same(here[key], there[key], f"{at}.{key}")
    elif isinstance(here, list) and isinstance(there, list):
        need(len(here) == len(there), f"{at}: {len(here)} and {len(there)} entries")
        for i, (a, b) in enumerate(zip(here, there)):
            same(a, b, f"{at}[{i}]")
    elif isinstance(here, float) or isinstance(there, float):
        need(here is not None and there is not None, f"{at}: {here} and {there}")
        # Correlations and the like lie between −1 and 1 and may be as good as zero.
        need(math.isclose(here, there, rel_tol=1e-6, abs_tol=1e-6), f"{at}: {here} and {there}")
    else:
        need(here == there, f"{at}: {here!r} and {there!r}")


def copied(source, to, line_ends=None):
    shutil.copytree(BLIND / source, to)
    if line_ends:
        for path in [p for p in to.rglob("*") if p.suffix in (".toml", ".txt", ".csv")]:
            path.write_bytes(path.read_bytes().replace(b"\r\n", b"\n").replace(b"\n", line_ends))
    return to


def of_serve(program, campaign, work):
    """The page, and an order given on it."""
    child = subprocess.Popen(
        [*program.command, "serve", campaign, "--port", "0", "--json"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        env=program.environment, cwd=work,
    )  # fmt: skip
    try:
        url = json.loads(child.stdout.readline())["url"]

        host = url[: url.index("/", 8)]

        def fetched(address, **headers):
            with urllib.request.urlopen(urllib.request.Request(address, headers=headers), timeout=60) as answer:
                return answer.read().decode()

        def get(path):
            return fetched(url + path)

        page = get("")
        token = re.search(r'name="token" content="(\w+)"', page).group(1)
        report_at = host + html.unescape(re.search(r'name="report" content="(.+?)"', page).group(1))
        headers = {"Origin": host, "X-Lobestone-Token": token}

        def ordered(order):
            request = urllib.request.Request(url + "order", json.dumps(order).encode(), headers)
            need(urllib.request.urlopen(request, timeout=60).status < 300, f"{order} was refused")
            until = time.monotonic() + 300
            while (status := json.loads(get("status")))["job"] is not None:
                need(time.monotonic() < until, f"{order} does not end")
                time.sleep(0.3)
            need(status["last"]["ok"], f"{order}: {status}")

        # Twice: the report that was written is in use, and is replaced.
        ordered({"do": "refresh"})
        ordered({"do": "refresh"})
        report = fetched(report_at)
        need("<html" in report and campaign in report and "plotly" in report.lower(), f"no report: {report[:300]}")
    finally:
        child.terminate()
        child.wait(timeout=30)


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--quick", action="store_true")
    arguments.add_argument("--program", type=Path)
    arguments.add_argument("--reference", type=Path, help="the same program for this system")
    wanted = arguments.parse_args()
    program = (wanted.program or built(wanted.quick)).resolve()
    print(f"{program}: {program.stat().st_size / 1e6:.1f} MB")

    with tempfile.TemporaryDirectory(prefix="windows ", ignore_cleanup_errors=True) as folder:
        work = Path(folder) / "Zelle 7 Fräsen"
        work.mkdir()
        environment = {**os.environ, "WINEPREFIX": str(Path(folder) / "wine"), "WINEDEBUG": "-all", "WINEDLLOVERRIDES": "mscoree,mshtml="}
        environment.pop("DISPLAY", None)
        # A name that is not ASCII is one in Wine only where the locale says how it is written.
        environment.setdefault("LC_ALL", "C.UTF-8")
        tested = Program([*wine_here(), str(program)], environment)
        there = Program([str(wanted.reference.resolve())], dict(os.environ)) if wanted.reference else None

        def step(what, begun):
            print(f"{what}: {time.monotonic() - begun:.1f} s", flush=True)

        begun = time.monotonic()
        if not ON_WINDOWS:
            prepared(environment, tested.command[0])
            step("Wine made ready", begun)

        begun = time.monotonic()
        version = tested.text("--version")
        need(re.fullmatch(r"lobestone [\d.]+\r?\n", version), f"--version: {version!r}")
        step("the first start", begun)

        begun = time.monotonic()
        tested.text("demo", "demo", cwd=work)
        pages = sorted(p.name for p in (work / "demo").rglob("*.html"))
        need(pages and all((p.stat().st_size > 10_000) for p in (work / "demo").rglob("*.html")), f"demo: pages {pages}")
        step(f"demo, {', '.join(pages)}", begun)

        cell = copied("frf-9114", work / "cell mit Lücke", b"\r\n")
        begun = time.monotonic()
        found = tested.document("diagnose", cell.name, cwd=work)
        need((found["verdict"], found["candidates"][0]["effect"]) == ("effect", "tool-flexibility"), f"verdict {found['verdict']}")
        step("diagnose, with the true verdict", begun)

        begun = time.monotonic()
        # One whose model fits: where nothing determines the parameters two libraries of sines end at two places. By the path that
        # Windows writes.
        sound = copied("frf-9000", work / "sound", b"\r\n")
        fit = tested.document("calibrate", f".\\{sound.name}", cwd=work)
        forces = copied("force-9439", work / "drill", b"\r\n")
        coefficients = tested.document("cfc", forces.name, cwd=work)
        if there:
            same(fit, there.document("calibrate", sound.name, cwd=work))
            same(coefficients, there.document("cfc", forces.name, cwd=work))
        step("calibrate and cfc" + (", with the numbers of the other system" if there else ""), begun)

        begun = time.monotonic()
        tested.text("add", cell.name, "tool-flexibility", cwd=work)
        tested.text("undo", cell.name, cwd=work)
        step("add and undo", begun)

        begun = time.monotonic()
        (work / "nights.csv").write_bytes(f"campaign,robot\r\n{cell.name},r1\r\n{forces.name},r1\r\nnowhere,r2\r\n".encode())
        for _ in range(2):
            tested.text("batch", "nights.csv", "--out", "results", "--do", "calibrate", cwd=work)
        tested.text("fleet", "results", cwd=work)
        need((work / "results/fleet/report.html").exists(), "fleet: no report")
        need(len((work / "results/fleet/all.csv").read_text(encoding="utf-8").splitlines()) >= 4, "fleet: rows are missing")
        step("batch and fleet", begun)

        begun = time.monotonic()
        wrong = tested.run("calibrate", "no such folder", cwd=work)
        need(wrong.returncode == 1 and b"no such folder" in wrong.stderr, f"an error without its file: {wrong.stderr!r}")
        need(tested.run("calibrait", cell.name, cwd=work).returncode == 2, "wrong usage is not status 2")
        step("errors", begun)

        begun = time.monotonic()
        of_serve(tested, cell.name, work)
        step("serve: page, order, done", begun)
        if not ON_WINDOWS:
            server = Path("/usr/lib/wine/wineserver")
            subprocess.run([str(server) if server.exists() else "wineserver", "-k"], env=environment, check=False)
    print("all holds")


if __name__ == "__main__":
    main()
