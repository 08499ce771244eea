#!/usr/bin/env python3
"""Writes the numbers in the README's examples anew.

    python3 scripts/readme_examples.py [--program target/release/lobestone]

Every `$ lobestone …` of its text blocks is run on copies of the test campaigns; each line shown under it is replaced by the next
printed line that says the same but for its numbers. A line that is not found stays and is named, and the exit status is 1.
tests/integration/book.rs fails where the README shows what the program does not print. Only the standard library is used.
"""

import argparse
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
CAMPAIGNS = "tests/data/blind"


def shape(line):
    """A line without its numbers, bars and spacing."""
    line = re.sub(r"[█▉▊▋▌▍▎▏ ]+", " ", line)
    return re.sub(r"[-+]?\d[\d.e+-]*", "#", line).strip()


def is_shown(shown, printed):
    if shown.endswith(" …"):
        return shape(printed).startswith(shape(shown[:-2]))
    return shape(shown) == shape(printed)


def refreshed(block, program, folder, lost):
    lines, printed = [], []
    for line in block:
        if line.startswith("$ lobestone "):
            command = line.removeprefix("$ lobestone ").split("#")[0].split()
            done = subprocess.run([program, *command], cwd=folder, capture_output=True, text=True, check=False)
            printed = iter(done.stdout.replace("\xa0", " ").splitlines())
        elif line.strip() not in ("", "…") and not line.lstrip().startswith("#"):
            found = next((p for p in printed if is_shown(line, p)), None)
            if found is None:
                lost.append(line)
            elif line.endswith(" …"):
                line = found[: len(line) - 2] + " …"
            else:
                line = found.rstrip()
        lines.append(line)
    return lines


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", default=str(ROOT / "target/release/lobestone"))
    program = str(pathlib.Path(parser.parse_args().program).resolve())
    readme = ROOT / "README.md"
    lines, out, lost = readme.read_text().split("\n"), [], []
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(ROOT / CAMPAIGNS, pathlib.Path(folder) / CAMPAIGNS)
        shutil.copytree(ROOT / CAMPAIGNS / "frf-9114", pathlib.Path(folder) / "CAMPAIGN")
        block = None
        for line in lines:
            if block is not None and line == "```":
                out += refreshed(block, program, folder, lost)
                block = None
            if block is None:
                out.append(line)
            else:
                block.append(line)
            if line == "```text":
                block = []
    readme.write_text("\n".join(out))
    for line in lost:
        print(f"not printed: {line}", file=sys.stderr)
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
