#!/usr/bin/env python3
"""Do the standard deviations of `lobestone modal` cover what two halves of a set differ by?

    python3 scripts/split_coverage.py [--binary PATH] [--band FROM:TO] SET.uff ...      (pip install pyuff numpy)

Each file is one set of FRFs (UFF 58, all of one structure). Its odd FRFs (the first, third, …) and its even ones are
analysed as two sets that know nothing of each other, by reference where there are several. Modes of the two that are
each other's nearest and nearer than both half-widths (or a line and a half) are pairs; for each pair the difference of
frequency and of damping ratio is held against the root of the sum of both squared standard deviations.

Printed per set and for all: pairs, modes of one half without a partner in the other, share of the differences within
2 combined standard deviations (wanted: at least 95 %), and the median of |difference| over the combined standard
deviation (0.67 where the standard deviations are exact, smaller where they are wider than they need to be).
"""

import argparse
import json
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pyuff

FRF = 4


def datasets(path):
    """The datasets 58 of a file that are FRFs."""
    universal = pyuff.UFF(str(path))
    types = universal.get_set_types()
    found = [universal.read_sets(k) for k, kind in enumerate(types) if kind == 58]
    return [d for d in found if d["func_type"] == FRF]


def frfs(path):
    """The FRFs of a file, by reference then in the order of the file."""
    found = datasets(path)
    references = sorted({(d["ref_node"], d["ref_dir"]) for d in found})
    responses = {(d["rsp_node"], d["rsp_dir"]) for d in found}
    # A roving hammer has one response and many references: those are one run.
    if len(references) > len(responses):
        return [found]
    return [[d for d in found if (d["ref_node"], d["ref_dir"]) == r] for r in references]


def write(path, datasets):
    universal = pyuff.UFF(str(path))
    for d in datasets:
        d = dict(d)
        d.setdefault("binary", 1)
        universal._write_set(d, "add")


def modes(binary, path, band):
    command = [binary, "--json", "modal", "--quiet", str(path)] + (["--band", band] if band else [])
    run = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    if run.returncode:
        raise SystemExit(f"{' '.join(command)}: failed")
    return json.loads(run.stdout)["global"]


def pairs(a, b, line_hz):
    """Modes of two lists that are each other's nearest and overlap."""

    def nearest(mode, others):
        return min(others, key=lambda o: abs(o["frequency_hz"] - mode["frequency_hz"]), default=None)

    found = []
    for one in a:
        other = nearest(one, b)
        if other is None or nearest(other, a) is not one:
            continue
        width = sum(m["frequency_hz"] * m["damping_ratio"] for m in (one, other))
        if abs(one["frequency_hz"] - other["frequency_hz"]) < max(width, 1.5 * line_hz):
            found.append((one, other))
    return found


def judge(name, binary, path, band, verbose):
    with tempfile.TemporaryDirectory() as folder:
        halves = [Path(folder) / "odd.uff", Path(folder) / "even.uff"]
        runs = frfs(path)
        write(halves[0], [d for run in runs for d in run[0::2]])
        write(halves[1], [d for run in runs for d in run[1::2]])
        x = np.asarray(runs[0][0]["x"])
        found = [modes(binary, half, band) for half in halves]
    both = pairs(*found, float(x[2] - x[1]))
    ratios = []
    for one, other in both:
        row = []
        for value, std in (("frequency_hz", "frequency_std_hz"), ("damping_ratio", "damping_std")):
            row.append(abs(one[value] - other[value]) / np.hypot(one[std], other[std]))
        ratios.append(row)
        if verbose:
            print(
                f"  {one['frequency_hz']:10.3f} {other['frequency_hz']:10.3f} Hz {row[0]:6.2f} sigma   "
                f"{100 * one['damping_ratio']:7.3f} {100 * other['damping_ratio']:7.3f} % {row[1]:6.2f} sigma"
            )
    alone = sum(map(len, found)) - 2 * len(both)
    show(name, np.array(ratios).reshape(-1, 2), alone)
    return np.array(ratios).reshape(-1, 2), alone


def show(name, ratios, alone):
    if not len(ratios):
        print(f"{name:40} no pairs, {alone} alone")
        return
    inside = 100 * np.mean(ratios < 2, axis=0)
    middle = np.median(ratios, axis=0)
    print(
        f"{name:40} {len(ratios):4} pairs {alone:4} alone   f {inside[0]:5.1f} % within 2 (median {middle[0]:.2f})   "
        f"zeta {inside[1]:5.1f} % (median {middle[1]:.2f})   both {100 * np.mean(ratios < 2):5.1f} %"
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", default=str(Path(__file__).resolve().parent.parent / "target/release/lobestone"))
    parser.add_argument("--band", help="FROM:TO, Hz")
    parser.add_argument("--verbose", action="store_true", help="print every pair")
    parser.add_argument("sets", nargs="+", type=Path)
    arguments = parser.parse_args()
    every, alone = [], 0
    for path in arguments.sets:
        ratios, rest = judge(path.name, arguments.binary, path, arguments.band, arguments.verbose)
        every.append(ratios)
        alone += rest
    show("all", np.vstack(every), alone)


if __name__ == "__main__":
    main()
