#!/usr/bin/env python3
"""Packs practice campaigns of an independent simulator as test fixtures: one for each effect, as small as shows it.

    pack_practice.py PRACTICE [--out tests/data/practice]

PRACTICE: the unpacked practice-frf and practice-cutting, truth/ among them. Each fixture is a gzipped JSON document
{"truth": {…}, "files": {path: text}}. Only the standard library is used.
"""

import argparse
import gzip
import json
import pathlib
import subprocess
import sys
import tempfile

HERE = pathlib.Path(__file__).resolve().parent
# All lines: with half of them weights and noise follow each other, and a joint comes out five standard errors off.
FEWER = ["--postures", "p1,p3,p5", "--references", "1X,1Y,1Z"]
CUTS = {
    "mill-chatter": "01,04,13,16",
    "mill-crosstalk": "01,03,13,15",
    "mill-dynamometer-resonance": "01,04,13,15",
    "mill-nonlinear-drift": "01,05,09,13",
    "mill-runout": "01,05,13",
    "mill-size-effect": "01,05,09,13",
    "mill-speed-dependence": "01,04,13,16",
    "mill-tilt": "01,04,13,16",
    "mill-tool-wear": "01,06,10,13",
    "drill-chisel-edge": "01,02,10,11",
    "drill-margin-friction": "01,02,10,13",
    "drill-size-effect": "01,05,12,13",
    "drill-tool-wear": "03,10,14,15",
}
FRFS = ["joint-transverse-compliance", "load-dependent-stiffness", "sensor-misalignment", "time-delay"]


def packed(source, options):
    with tempfile.TemporaryDirectory() as folder:
        subprocess.run([sys.executable, HERE / "thin_campaign.py", source, folder, *options], check=True)
        root = pathlib.Path(folder)
        return {str(f.relative_to(root)): f.read_text() for f in sorted(root.rglob("*")) if f.is_file()}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("practice", type=pathlib.Path)
    parser.add_argument("--out", type=pathlib.Path, default=HERE.parent / "tests/data/practice")
    args = parser.parse_args()
    args.out.mkdir(parents=True, exist_ok=True)
    options = {name: ["--cuts", cuts] for name, cuts in CUTS.items()}
    options.update({f"frf-careful-{effect}": FEWER for effect in FRFS})
    for name, thinned in options.items():
        truth = json.loads((args.practice / "truth" / f"{name}.json").read_text())
        fixture = {"truth": truth, "files": packed(args.practice / name, thinned)}
        text = json.dumps(fixture, sort_keys=True, ensure_ascii=False)
        # No time stamp: the same campaign gives the same bytes.
        (args.out / f"{name}.json.gz").write_bytes(gzip.compress(text.encode(), 9, mtime=0))


if __name__ == "__main__":
    main()
