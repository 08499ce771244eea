#!/usr/bin/env python3
"""Does `lobestone localise` find the place of physics that the library has no name for?

    localise_marks.py [--count 4] [--first-seed 1] [--kinds soft-servo,…] [--share 0.3] [--lobestone target/release/lobestone] [--keep DIR]

For each kind of `simulate --unknown` whose place is known, `--count` campaigns: whether the first place (or one it is tied with) is
the right one, how far the form's parameters are from the truth (where truth and form have any in common), and how many times the
noise is left. `none` campaigns: whether a
place is called significant. Explicit seeds; nothing but lobestone and Python.
"""

import argparse
import json
import math
import pathlib
import subprocess
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
AXES = "xyz"


def axis(vector):
    return AXES[max(range(3), key=lambda i: abs(vector[i]))]


# Labels of the places that are right, from the truth. A body's fixing to the ground is known by its axis in base coordinates only
# roughly where it runs between two of them: the axis it mostly follows.
def resonator(t):
    return [f"{t['site']}.{axis(a)}" for a in t["parameters"]["axis"]]


def joint(t):
    return [t["site"], t["site"].replace("joint", "drive")]


def hose(t):
    # The lab hangs it on the far end of a link. The axes of joints 4, 5 and 6 meet: the end of link 4 is where link 5 turns.
    links = [t["site"]] + ["link-5"] * (t["site"] == "link-4")
    return [f"{link}-ground.{axis(t['parameters']['direction'])}" for link in links]


KINDS = {
    "two-resonators": resonator,
    "resonator-elsewhere": resonator,
    "resonator-two-axes": resonator,
    "soft-servo": joint,
    "bearing-radial": lambda t: [f"{t['site'].replace('joint', 'bearing')}.t{a}" for a in "xy"],
    "clamp-to-table": lambda t: [f"tool-ground.{axis(t['parameters']['direction'])}"],
    "hose-to-ground": hose,
    "floor-mode": lambda t: [f"base.{axis(t['parameters']['direction'])}"],
    "base-sliding": lambda t: ["base.x", "base.y", "bearing-1.tx", "bearing-1.ty"],
    "none": lambda t: [],
}


def pairs(kind, truth, first):
    """(name, truth, found, its standard error) of the parameters that the forms at the first place and the truth share."""
    t, out = truth["parameters"], []

    def of(true, name):
        return (true, t[true], first["parameters"].get(name), first["errors"].get(name))

    if kind.startswith("resonator") or kind == "two-resonators":
        names = ["mass_kg", "frequency_hz", "damping_ratio"]
        second = first.get("second") or {"place": "", "parameters": {}, "errors": {}}
        fits = [
            (part["place"], [(part["parameters"].get(p + n), part["errors"].get(p + n)) for n in names])
            for part in (first, second)
            for p in ("", "second_")
        ]
        fits = [(where, fit) for where, fit in fits if all(value is not None for value, _ in fit)]
        along = [where for where, _ in fits]
        for i, a in enumerate(t["axis"]):
            here = f"{truth['site']}.{axis(a)}"
            if kind != "two-resonators" and here not in along:
                continue
            row = [t[n][i] for n in names]
            # That along its own axis where there is one, else whatever stands for it.
            own = [fit for where, fit in fits if where == here] or [fit for _, fit in fits]
            if own:
                best = min(own, key=lambda f: abs(math.log(f[1][0] / row[1])))
                out += [(n, true, *value) for n, true, value in zip(names, row, best)]
    elif kind == "clamp-to-table" or kind == "hose-to-ground":
        out.append(of("stiffness_n_per_m", "stiffness_n_per_m"))
    elif kind == "bearing-radial":
        out.append(of("radial_n_per_m", "stiffness_n_per_m"))
    elif kind == "base-sliding":
        out.append(of("sliding_n_per_m", "stiffness_n_per_m"))
    return [p for p in out if p[2] is not None]


def run(*command):
    return subprocess.run(command, capture_output=True, text=True)


def main():
    a = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    a.add_argument("--count", type=int, default=4)
    a.add_argument("--first-seed", type=int, default=1)
    a.add_argument("--kinds", default=",".join(KINDS))
    a.add_argument("--share", type=float)
    a.add_argument("--lobestone", default=str(ROOT / "target/release/lobestone"))
    a.add_argument("--keep")
    a = a.parse_args()
    work = pathlib.Path(a.keep or tempfile.mkdtemp())
    work.mkdir(parents=True, exist_ok=True)
    total = right = compared = fine = known = low = none = silent = 0
    for kind in a.kinds.split(","):
        for seed in range(a.first_seed, a.first_seed + a.count):
            folder = work / f"{kind}-{seed}"
            if not folder.exists():
                hide = [] if kind == "none" else ["--unknown", kind]
                hide += ["--share", str(a.share)] if a.share and hide else []
                made = run(a.lobestone, "simulate", "--out", str(folder), "--seed", str(seed), *hide)
                if made.returncode:
                    print(kind, seed, made.stderr.strip())
                    continue
            truth = json.loads((work / f"{kind}-{seed}.truth.json").read_text())
            start = time.time()
            done = run(a.lobestone, "localise", str(folder), "--json")
            seconds = time.time() - start
            if done.returncode:
                print(kind, seed, done.stderr.strip())
                continue
            answer = json.loads(done.stdout)
            first = answer["places"][0]
            told = [first["place"], *first["tied_with"]]
            places = KINDS[kind](truth)
            if kind == "none":
                none += 1
                silent += not answer["significant"]
                print(f"none {seed}: significant {answer['significant']} {seconds:.1f} s")
                continue
            hit = any(p in places for p in told)
            off = pairs(kind, truth, first) if hit else []
            worst = max((abs(f / t - 1) for _, t, f, _ in off), default=None)
            sigmas = max((abs(f - t) / e if e else math.inf for _, t, f, e in off), default=None)
            total += 1
            right += hit
            compared += worst is not None
            fine += worst is not None and worst < 0.15
            known += worst is not None and (worst < 0.15 or sigmas < 3)
            low += bool(first["left"] and first["left"] <= 1.1)
            print(
                f"{kind} {seed}: {'right' if hit else 'WRONG'}{'' if answer['significant'] else ' (not significant)'} "
                f"{'/'.join(told)} for {'/'.join(places)}, {first['form']}, left {first['left']:.3f} "
                f"of {answer['baseline']['reduced_chi2']:.3f}, parameters off "
                f"{'–' if worst is None else f'{100 * worst:.0f} % ({sigmas:.1f} σ)'}, {seconds:.1f} s",
                flush=True,
            )
    print(f"place {right} of {total}, parameters within 15 % {fine} of {compared} (or 3 σ: {known}), left at most 1.1 {low}; none: silent {silent} of {none}")


if __name__ == "__main__":
    main()
