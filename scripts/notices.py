#!/usr/bin/env python3
"""Lists the crates that the program is built of, with their licences, and checks that each licence is one we may ship under.

    notices.py [--check] [--texts FILE] [--out reports/third-party.md]

Without options it writes the table. `--check` writes nothing and fails where the table is not that of Cargo.lock or a licence
is not allowed. `--texts` writes the licence texts as the crates carry them, for whoever hands on a binary.
Asks `cargo metadata --locked` only: what was fetched for the build is all that is needed.
"""

import argparse
import json
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
# Licences that ask for no more than their text with a binary.
ALLOWED = {
    "0BSD", "Apache-2.0", "Apache-2.0 WITH LLVM-exception", "BSD-2-Clause", "BSD-3-Clause", "BSL-1.0", "CC0-1.0", "CDLA-Permissive-2.0",
    "ISC", "MIT", "MIT-0", "MPL-2.0", "NCSA", "Unicode-3.0", "Unlicense", "Zlib", "bzip2-1.0.6",
}  # fmt: skip
TEXTS = re.compile(r"^(licen[sc]e|copying|notice|unlicense)", re.IGNORECASE)
# What pages and figures hold that is no crate: name, licence, where its text is.
EMBEDDED = [
    ("plotly.js", "MIT", "src/report/interactive/plotly-LICENSE.txt"),
    ("DejaVu Sans", "Bitstream Vera", "src/report/fonts/LICENSE.txt"),
]
# A crate counts as large from so many crates on that nothing else brings.
LARGE = 5


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--check", action="store_true")
    arguments.add_argument("--texts", type=pathlib.Path)
    arguments.add_argument("--out", type=pathlib.Path, default=ROOT / "reports/third-party.md")
    options = arguments.parse_args()
    packages, edges, root = shipped()
    forbidden = [p for p in packages.values() if p["id"] != root and not is_allowed(p["license"] or "")]
    for p in forbidden:
        print(f"{p['name']} {p['version']}: licence {p['license'] or 'not stated'} is not one that we may ship under", file=sys.stderr)
    table = page(packages, edges, root)
    if options.texts:
        options.texts.write_text(texts(packages, root))
    if options.check:
        stale = not options.out.exists() or options.out.read_text() != table
        if stale:
            print(f"{options.out} is not what Cargo.lock says: run scripts/notices.py", file=sys.stderr)
        raise SystemExit(bool(stale or forbidden))
    options.out.write_text(table)
    print(f"wrote {options.out}: {len(packages) - 1} crates")
    raise SystemExit(bool(forbidden))


def shipped():
    """Packages that the program with all features is built of on Linux (no test or build tools), their edges, and our own id."""
    host = re.search(r"host: (.*)", subprocess.run(["rustc", "-vV"], capture_output=True, text=True, check=True).stdout).group(1)
    run = subprocess.run(
        ["cargo", "metadata", "--locked", "--format-version", "1", "--filter-platform", host],
        cwd=ROOT, capture_output=True, text=True, check=True,
    )  # fmt: skip
    metadata = json.loads(run.stdout)
    nodes = {node["id"]: node for node in metadata["resolve"]["nodes"]}
    root = metadata["resolve"]["root"]
    edges, waiting = {}, [root]
    while waiting:
        one = waiting.pop()
        if one in edges:
            continue
        normal = [d["pkg"] for d in nodes[one]["deps"] if any(k["kind"] is None for k in d["dep_kinds"])]
        edges[one] = sorted(normal)
        waiting.extend(normal)
    return {p["id"]: p for p in metadata["packages"] if p["id"] in edges}, edges, root


def is_allowed(expression):
    """Whether an SPDX expression can be met with allowed licences only ("/" is how old crates write OR)."""
    tokens = re.findall(r"\(|\)|[^\s()]+", expression.replace("/", " OR "))
    words = []
    for token in tokens:
        # `X WITH exception` is one licence.
        if words and words[-1].endswith(" WITH"):
            words[-1] += f" {token}"
        elif token == "WITH" and words:
            words[-1] += " WITH"
        else:
            words.append(token)
    if not words:
        return False
    python = [{"OR": "or", "AND": "and", "(": "(", ")": ")"}.get(w) or str(w in ALLOWED) for w in words]
    return bool(eval(" ".join(python), {"__builtins__": {}}))  # only or, and, parentheses, True and False


def reached(edges, start, without=None):
    seen, waiting = set(), [start]
    while waiting:
        one = waiting.pop()
        if one not in seen and one != without:
            seen.add(one)
            waiting.extend(edges[one])
    return seen


def page(packages, edges, root):
    others = sorted((p for i, p in packages.items() if i != root), key=lambda p: (p["name"], p["version"]))
    every = reached(edges, root)
    brings = []
    for direct in edges[root]:
        own = every - reached(edges, root, without=direct)
        brings.append((len(own), packages[direct]["name"], sorted({packages[i]["name"] for i in own - {direct}})))
    brings.sort(key=lambda b: (-b[0], b[1]))
    lines = [
        "# Third-party crates",
        "",
        "Made by `python3 scripts/notices.py`; `.ci/run` checks it. The texts of the licences: `scripts/notices.py --texts FILE`.",
        "",
        f"With all features on Linux the program is built of {len(others)} crates besides its own.",
        "",
        "## What the largest bring",
        "",
        "Crates that would be gone without the one named (itself included).",
        "",
        "| crate | crates | for instance |",
        "|---|---|---|",
    ]
    for count, name, own in brings:
        if count >= LARGE:
            lines.append(f"| {name} | {count} | {', '.join(own[:6])}{', …' if len(own) > 6 else ''} |")
    lines += ["", "## Not crates", "", "In the pages and figures that the program writes.", "", "| what | licence | text |", "|---|---|---|"]
    lines += [f"| {name} | {licence} | `{text}` |" for name, licence, text in EMBEDDED]
    lines += ["", "## All", "", "| crate | version | licence | source |", "|---|---|---|---|"]
    for p in others:
        lines.append(f"| {p['name']} | {p['version']} | {p['license']} | {p['repository'] or p['homepage'] or 'crates.io'} |")
    return "\n".join(lines) + "\n"


def texts(packages, root):
    by_text = {}
    for p in packages.values():
        folder = pathlib.Path(p["manifest_path"]).parent
        for path in sorted(folder.iterdir()) if p["id"] != root else []:
            if TEXTS.match(path.name) and path.is_file():
                text = path.read_text(errors="replace").strip()
                by_text.setdefault(text, []).append(f"{p['name']} {p['version']}")
    for name, _, path in EMBEDDED:
        by_text.setdefault((ROOT / path).read_text().strip(), []).append(name)
    parts = [", ".join(sorted(set(names))) + "\n\n" + text for text, names in by_text.items()]
    return ("\n\n" + "=" * 78 + "\n\n").join(sorted(parts)) + "\n"


if __name__ == "__main__":
    main()
