#!/usr/bin/env python3
"""Draws what each effect does to a measurement, and finds the effects of the library that come nearest to it.

    python3 scripts/effect_fingerprints.py [--program target/release/lobestone] [EFFECT ...]

For each effect one campaign in which it hides at a usual size: `lobestone simulate --effect` with a careful measurement of little
noise, or a practice campaign of tests/data/practice for effects whose records `simulate` does not make. Pictures are those of
`lobestone report`, put into docs/pictures/effects under the effect's name (FRFs: error against noise without and with the effect, and
the FRF that it changes most; forces: a turn of the tool without and with it). How near others come is what `lobestone diagnose` says of its candidates:
docs/pictures/effects/look-alikes.json, which scripts/effect_catalogue.py writes into docs/effects.md. Only the standard library is used.
"""

import argparse
import gzip
import json
import pathlib
import shutil
import tempfile

from random_campaigns import lobestone

ROOT = pathlib.Path(__file__).resolve().parent.parent
OUT = ROOT / "docs/pictures/effects"
# Of the campaign; another one where an effect drawn from it is too small to be seen.
SEED = 5
# Milled records with frequencies and drifts of their own, and drilling: from an independent simulator.
PRACTICE = {
    "chatter": "mill-chatter",
    "dynamometer-resonance": "mill-dynamometer-resonance",
    "nonlinear-drift": "mill-nonlinear-drift",
    "chisel-edge": "drill-chisel-edge",
    "margin-friction": "drill-margin-friction",
}
# Forces that every model of simulated cuts has already.
NEVER_MISSING = ["edge-force"]
# The pictures of a report that show it, the best first, and the name each gets here.
PICTURES = {
    "structure": [(["missing-map"], ""), (["missing-frf-1"], "-frf")],
    "cutting": [(["waveform-1", "misfit-drilling"], "")],
}
# Vibration beside the rotation is not in the mean of the turns.
BETTER = {"chatter": [(["waveform-orders"], "")]}


def campaign(program, effect, folder):
    """A folder in which the effect hides."""
    identity = effect["effect"]
    out = folder / identity
    if identity in PRACTICE:
        packed = json.load(gzip.open(ROOT / f"tests/data/practice/{PRACTICE[identity]}.json.gz"))
        for path, text in packed["files"].items():
            (out / path).parent.mkdir(parents=True, exist_ok=True)
            (out / path).write_text(text)
        return out
    arguments = ["simulate", "--effect", identity, "--out", str(out), "--seed", str(SEED)]
    if effect["domain"] == "structure":
        arguments += ["--kind", "careful", "--noise", "0.02"]
        if identity.startswith("amplitude"):
            arguments += ["--force-levels", "200,50"]
    lobestone(program, *arguments)
    return out


def nearest(found, hidden):
    """Effects by the share that each explains of what the hidden one does, the largest first."""
    candidates = [c for c in found["candidates"] if c["reduced_chi2"] is not None]
    own = [c for c in candidates if c["effect"] == hidden]
    if not own:
        raise SystemExit(f"{hidden} is no candidate where it hides")
    least = min(c["reduced_chi2"] for c in own)
    bare = found["baseline"]["reduced_chi2"]
    share = {}
    for c in candidates:
        if c["effect"] != hidden:
            explained = (bare - c["reduced_chi2"]) / (bare - least)
            share[c["effect"]] = max(share.get(c["effect"], 0.0), explained)
    ranked = sorted(share.items(), key=lambda item: -item[1])
    return {
        "verdict": found["effect"] or found["verdict"],
        "nearest": [{"effect": e, "share": round(min(max(s, 0.0), 1.0), 2)} for e, s in ranked[:3]],
    }


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("effects", nargs="*", metavar="EFFECT", help="default: all")
    arguments.add_argument("--program", default=str(ROOT / "target/release/lobestone"))
    options = arguments.parse_args()
    OUT.mkdir(parents=True, exist_ok=True)
    table = OUT / "look-alikes.json"
    known = json.loads(table.read_text()) if table.exists() else {}
    effects = lobestone(options.program, "explain")["effects"]
    ids = {e["effect"] for e in effects}
    for effect in effects:
        identity = effect["effect"]
        if identity in NEVER_MISSING or options.effects and identity not in options.effects:
            continue
        with tempfile.TemporaryDirectory() as scratch:
            folder = campaign(options.program, effect, pathlib.Path(scratch))
            found = lobestone(options.program, "diagnose", str(folder))
            known[identity] = nearest(found, identity)
            lobestone(options.program, "report", str(folder))
            for names, suffix in BETTER.get(identity, PICTURES[effect["domain"]]):
                made = next(p for p in (folder / "report" / f"{n}.png" for n in names) if p.exists())
                shutil.copyfile(made, OUT / f"{identity}{suffix}.png")
        known = {i: known[i] for i in sorted(known) if i in ids}
        table.write_text(json.dumps(known, indent=1) + "\n")
        print(identity, known[identity], flush=True)
    for path in OUT.glob("*.png"):
        if path.stem.removesuffix("-frf") not in ids:
            path.unlink()


if __name__ == "__main__":
    main()
