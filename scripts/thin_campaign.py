#!/usr/bin/env python3
"""Copies a campaign with less in it, so that it is small enough to be a test fixture.

    thin_campaign.py FROM TO [--every N] [--postures p1,p2] [--references 1X,1Y] [--cuts 01,05]

--every N       keep every N-th spectral line of the (evenly spaced, ASCII) UFF 58 files and FRF tables
--postures      keep these postures and their FRFs
--references    keep FRFs excited there: node and direction
--cuts          keep these cuts (their records are copied as they are)

Only the standard library is used; campaign.toml is copied table by table, comments included.
"""

import argparse
import pathlib
import re
import shutil

AXES = " XYZ"


def tables(text):
    """The pieces of a TOML file: what comes before the first table, then table after table."""
    starts = [m.start() for m in re.finditer(r"^\[", text, re.M)] + [len(text)]
    return [text[: starts[0]]] + [text[a:b] for a, b in zip(starts, starts[1:])]


def value(table, key):
    found = re.search(rf'^{key}\s*=\s*"([^"]*)"', table, re.M)
    return found and found.group(1)


def kept(table, args):
    if table.startswith("[[posture]]"):
        return not args.postures or value(table, "id") in args.postures
    if table.startswith("[[frf]]"):
        return not args.postures or value(table, "posture") in args.postures
    if table.startswith("[[cut]]"):
        return not args.cuts or value(table, "id") in args.cuts
    return True


def thin_uff(text, every, references):
    out = []
    for block in text.split("    -1\n")[1::2]:
        lines = block.splitlines()
        dof, axis = lines[6], lines[7]
        reference = int(dof[66:76]), AXES[abs(int(dof[76:80]))]
        if references and f"{reference[0]}{reference[1]}" not in references:
            continue
        form, count = int(axis[:10]), int(axis[10:20])
        even, start, step = int(axis[20:30]), float(axis[30:43]), float(axis[43:56])
        if form != 6 or even != 1:
            raise SystemExit("only complex double, evenly spaced ASCII data can be thinned")
        numbers = " ".join(lines[12:]).split()
        pairs = list(zip(numbers[0::2], numbers[1::2]))[:count][::every]
        lines[7] = f"{form:10d}{len(pairs):10d}{even:10d}{start:13.5e}{step * every:13.5e}{0.0:13.5e}"
        flat = [f"{float(x):20.11e}" for pair in pairs for x in pair]
        rows = ["".join(flat[i : i + 4]) for i in range(0, len(flat), 4)]
        out.append("    -1\n" + "\n".join([line.rstrip() for line in lines[:12]] + rows) + "\n    -1\n")
    return "".join(out)


def thin_csv(text, every, references):
    """A table of FRFs: frequency_hz,re(2X/1Y),im(2X/1Y),…"""
    head, *rows = text.splitlines()
    names = head.split(",")
    columns = [i for i, name in enumerate(names) if i == 0 or not references or name.split("/")[-1].rstrip(")") in references]
    lines = [names] + [row.split(",") for row in rows[::every]]
    return "".join(",".join(line[i] for i in columns) + "\n" for line in lines)


def thin(source, target, args):
    """Only ASCII files can be thinned; others are copied as they are where nothing but postures is left out."""
    if args.every == 1 and not args.references:
        shutil.copyfile(source, target)
    elif source.suffix == ".csv":
        target.write_text(thin_csv(source.read_text(), args.every, args.references))
    else:
        target.write_text(thin_uff(source.read_text(), args.every, args.references))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("source", type=pathlib.Path)
    parser.add_argument("target", type=pathlib.Path)
    parser.add_argument("--every", type=int, default=1)
    for name in ("--postures", "--references", "--cuts"):
        parser.add_argument(name, type=lambda s: set(s.split(",")), default=set())
    args = parser.parse_args()

    parts = [t for t in tables((args.source / "campaign.toml").read_text()) if kept(t, args)]
    args.target.mkdir(parents=True, exist_ok=True)
    (args.target / "campaign.toml").write_text("".join(parts).rstrip() + "\n")
    for table in parts:
        file = value(table, "file")
        if not file:
            continue
        target = args.target / file
        target.parent.mkdir(parents=True, exist_ok=True)
        if table.startswith("[[frf]]"):
            thin(args.source / file, target, args)
        else:
            shutil.copy(args.source / file, target)


if __name__ == "__main__":
    main()
