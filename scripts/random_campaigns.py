#!/usr/bin/env python3
"""Tries `lobestone diagnose` on simulated campaigns of which everything was drawn.

    random_campaigns.py [--count 50] [--first-seed 1000] [--lobestone target/release/lobestone]
                        [--lines-hz HZ] [--report reports/diagnosis_confusion.md] [--keep DIR]

Campaign by campaign: `lobestone simulate --random --seed S`, `lobestone diagnose --json`, verdict against truth. Writes
a report (confusion matrix, false alarms, misses by how plainly the effect shows, calibration of the confidence, time)
and, beside it, a CSV with one row a campaign. A CSV that is there already is continued: campaigns in it are not run
again, so a long run may be stopped. Only the standard library is used.
"""

import argparse
import csv
import json
import math
import pathlib
import statistics
import subprocess
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parent.parent
FIELDS = [
    "seed", "kind", "truth", "site", "also", "sigmas", "nearest_library_effect", "nearest_excess_chi2", "noise",
    "verdict", "said", "said_site", "confidence", "companion", "indistinguishable", "outcome", "seconds",
]  # fmt: skip
# Upper ends of the classes of visibility, in standard deviations.
CLASSES = [10, 30, 100, 300, 1000, math.inf]
# An effect that sticks out of the noise less than this may honestly be called absent.
VISIBLE_SIGMAS = 10


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--count", type=int, default=50)
    arguments.add_argument("--first-seed", type=int, default=1000)
    arguments.add_argument("--lobestone", default=str(ROOT / "target/release/lobestone"))
    arguments.add_argument("--lines-hz", type=float, help="spacing of the spectral lines, to try this script quickly: with coarse "
                           "lines the noise is estimated badly and verdicts with it (default: as simulate has it)")
    arguments.add_argument("--report", type=pathlib.Path, default=ROOT / "reports/diagnosis_confusion.md")
    arguments.add_argument("--keep", type=pathlib.Path, help="keep the campaigns in this folder")
    options = arguments.parse_args()
    table = options.report.with_suffix(".csv")
    seeds = range(options.first_seed, options.first_seed + options.count)
    rows = [r for r in known(table) if int(r["seed"]) in seeds]
    done = {int(r["seed"]) for r in rows}
    for seed in seeds:
        if seed in done:
            continue
        row = one(options, seed)
        rows.append(row)
        write_rows(table, sorted(rows, key=lambda r: int(r["seed"])))
        print(f"{seed}: {row['truth']} {row['site']} -> {row['said']} {row['said_site']}: {row['outcome']}, "
              f"{row['confidence']}, {row['seconds']} s", flush=True)
    rows.sort(key=lambda r: int(r["seed"]))
    text = report(rows, options)
    temporary = options.report.with_suffix(".tmp")
    temporary.write_text(text)
    temporary.replace(options.report)
    print(f"wrote {options.report} and {table}")


def known(table):
    if not table.exists():
        return []
    with table.open(newline="") as file:
        return list(csv.DictReader(file))


def write_rows(table, rows):
    temporary = table.with_suffix(".csv.tmp")
    with temporary.open("w", newline="") as file:
        writer = csv.DictWriter(file, FIELDS)
        writer.writeheader()
        writer.writerows(rows)
    temporary.replace(table)


def lobestone(options, *arguments):
    run = subprocess.run([options.lobestone, *arguments, "--json"], capture_output=True, text=True)
    if run.returncode != 0:
        raise SystemExit(f"lobestone {' '.join(arguments)} failed:\n{run.stderr}")
    return json.loads(run.stdout)


def one(options, seed):
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.keep or pathlib.Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        spacing = ["--lines-hz", str(options.lines_hz)] if options.lines_hz else []
        name = str(folder / f"campaign-{seed}")
        written = lobestone(options, "simulate", "--random", "--seed", str(seed), "--out", name, *spacing)
        started = time.monotonic()
        found = lobestone(options, "diagnose", written["dir"])
        seconds = time.monotonic() - started
        truth = json.loads(pathlib.Path(written["truth"]).read_text())
    others = [label(a["effect"], a["site"]) for a in truth["also"]]
    nearest = truth.get("nearest_library_effect") or {}
    # With two effects the campaign is as plain as the plainer one.
    seen = [v["sigmas"] for v in [truth["visibility"], *(a["visibility"] for a in truth["also"])] if v]
    row = {
        "seed": seed,
        "kind": truth["kind"],
        "truth": truth["effect"],
        "site": truth["site"] or "",
        "also": " ".join(others),
        "sigmas": f"{max(seen):.1f}" if seen else "",
        "nearest_library_effect": nearest.get("effect") or "",
        "nearest_excess_chi2": f"{nearest['excess_chi2_per_value']:.3g}" if nearest else "",
        "noise": f"{truth['noise'][0]:.4f}",
        "verdict": found["verdict"],
        "said": found["effect"] or found["verdict"],
        "said_site": found["site"] or "",
        "confidence": f"{found['confidence']:.3f}",
        "companion": found.get("companion") or "",
        "indistinguishable": " ".join(found["indistinguishable"]),
        "seconds": f"{seconds:.1f}",
    }
    row["outcome"] = outcome(row)
    return row


def label(effect, site):
    return f"{effect}@{site}" if site else effect


def outcome(row):
    """What became of one campaign. Only `right` counts as right in the calibration of the confidence."""
    true = label(row["truth"], row["site"])
    said = label(row["said"], row["said_site"])
    truths = {true, *row["also"].split()}
    if said in truths:
        return "right"
    if row["truth"] == "none":
        return "false alarm"
    if row["said"] == "none":
        return "missed"
    if row["said"] == "unknown":
        return "not named"
    if row["said"] in {t.split("@")[0] for t in truths}:
        return "wrong site"
    if truths & set(row["indistinguishable"].split()):
        return "named as indistinguishable"
    return "wrong effect"


def wilson(hits, count, z=1.96):
    """95 % interval of a share (Wilson 1927)."""
    if count == 0:
        return 0.0, 1.0
    share = hits / count
    centre = share + z * z / (2 * count)
    half = z * math.sqrt(share * (1 - share) / count + z * z / (4 * count * count))
    scale = 1 + z * z / count
    # Rounding must not leave 0..1.
    return max(0.0, (centre - half) / scale), min(1.0, (centre + half) / scale)


def share(hits, count):
    if count == 0:
        return "– (none)"
    low, high = wilson(hits, count)
    return f"{hits} of {count} = {100 * hits / count:.0f} % ({100 * low:.0f}–{100 * high:.0f} %)"


def markdown(header, rows):
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(str(c) for c in row) + " |" for row in rows]) + "\n"


def confusion(rows):
    said = sorted({r["said"] for r in rows}, key=lambda s: (s in ("none", "unknown"), s))
    true = sorted({r["truth"] for r in rows}, key=lambda s: (s in ("none", "unknown"), s))
    body = []
    for effect in true:
        mine = [r for r in rows if r["truth"] == effect]
        counts = [sum(r["said"] == s for r in mine) or "·" for s in said]
        body.append([effect, *counts, sum(r["outcome"] == "wrong site" for r in mine) or "·", len(mine)])
    return markdown(["hidden ↓ said →", *said, "wrong site", "all"], body)


def by_visibility(rows):
    body = []
    low = 0
    for high in CLASSES:
        mine = [r for r in rows if r["truth"] not in ("none", "unknown") and low <= float(r["sigmas"]) < high]
        if mine:
            right = sum(r["outcome"] == "right" for r in mine)
            missed = sum(r["outcome"] == "missed" for r in mine)
            other = len(mine) - right - missed
            name = f"{low} and more" if high == math.inf else f"{low}–{high}"
            body.append([name, share(right, len(mine)), share(missed, len(mine)), other])
        low = high
    return markdown(["standard deviations", "right", "missed (said none)", "otherwise wrong"], body)


def calibration(rows):
    ends = [0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0001]
    body = []
    for low, high in zip(ends, ends[1:]):
        mine = [r for r in rows if low <= float(r["confidence"]) < high]
        if mine:
            right = sum(r["outcome"] == "right" for r in mine)
            said = statistics.mean(float(r["confidence"]) for r in mine)
            low_share, high_share = wilson(right, len(mine))
            fits = "yes" if low_share <= said <= high_share else "NO"
            body.append([f"{low:.2f}–{min(high, 1):.2f}", f"{said:.2f}", share(right, len(mine)), fits])
    confidences = [float(r["confidence"]) for r in rows]
    hits = [r["outcome"] == "right" for r in rows]
    brier = statistics.mean((c - h) ** 2 for c, h in zip(confidences, hits))
    summary = (f"\nOver all: mean confidence {statistics.mean(confidences):.3f}, right {statistics.mean(hits):.3f}; "
               f"Brier score {brier:.3f} (0 is perfect, 0.25 is a coin).\n")
    return markdown(["confidence", "mean said", "right", "said within the interval"], body) + summary


def report(rows, options):
    count = len(rows)
    right = sum(r["outcome"] == "right" for r in rows)
    none = [r for r in rows if r["truth"] == "none"]
    unknown = [r for r in rows if r["truth"] == "unknown"]
    effects = [r for r in rows if r["truth"] not in ("none", "unknown")]
    plain = [r for r in effects if float(r["sigmas"]) >= VISIBLE_SIGMAS]
    two = [r for r in effects if r["also"]]
    seconds = [float(r["seconds"]) for r in rows]
    spacing = f" --lines-hz {options.lines_hz}" if options.lines_hz else ""
    name = options.report.with_suffix(".csv").name
    rate = lambda part, what: share(sum(r["outcome"] == what for r in part), len(part))  # noqa: E731
    figures = [
        ["right (effect and site, none, or unknown)", share(right, count)],
        [f"right where the effect stands out by {VISIBLE_SIGMAS} standard deviations or more", rate(plain, "right")],
        ["false alarms on campaigns with nothing hidden", rate(none, "false alarm")],
        ["effects missed (said none)", rate(effects, "missed")],
        ["wrong site of the right effect", rate(effects, "wrong site")],
        ["wrong effect, but the right one named as indistinguishable", rate(effects, "named as indistinguishable")],
        ["physics outside the library called unknown", rate(unknown, "right")],
        ["two effects: one of them named", rate(two, "right")],
    ] + [[f"right on {kind} campaigns", rate([r for r in rows if r["kind"] == kind], "right")]
         for kind in ("careful", "direct", "dirty")]
    wrong = [[r["seed"], r["kind"], " + ".join([label(r["truth"], r["site"]), *r["also"].split()]), r["sigmas"],
              label(r["said"], r["said_site"]), r["confidence"], r["outcome"]]
             for r in rows if r["outcome"] != "right"]
    return f"""# Diagnosis of random campaigns

Made by

```sh
python3 scripts/random_campaigns.py --count {options.count} --first-seed {options.first_seed}{spacing}
```

{count} campaigns, seeds {options.first_seed} to {options.first_seed + options.count - 1}; one row a campaign in
[{name}]({name}). `lobestone simulate --random` draws kind, postures, robot, noise, what is hidden and how plainly it
shows; `lobestone diagnose` sees the folder only. Data and fit share the model: this tests the statistics of the
diagnosis, not its physics. Intervals are 95 % (Wilson).

{markdown(["", ""], figures)}
Time of `diagnose`: median {statistics.median(seconds):.1f} s, longest {max(seconds):.1f} s.

## Confusion matrix

Rows: what was hidden (of two effects the first). Columns: what was said, whatever the site.

{confusion(rows)}
## By how plainly the effect shows

Standard deviations at which an ideal test would see the effect after everything else was refitted (`visibility.sigmas`
in the truth; of two effects the plainer). Below {VISIBLE_SIGMAS} an effect may honestly be called absent.

{by_visibility(rows)}
## Does the confidence mean what it says?

{calibration(rows)}
## Every campaign that did not come out right

{markdown(["seed", "kind", "hidden", "standard deviations", "said", "confidence", "outcome"], wrong) if wrong else "None."}
"""


if __name__ == "__main__":
    main()
