#!/usr/bin/env python3
"""Tries `lobestone diagnose` on simulated campaigns of which everything was drawn.

    random_campaigns.py [--tier mixed] [--count 50] [--first-seed 1000] [--lobestone target/release/lobestone]
                        [--loops] [--lines-hz HZ] [--report reports/diagnosis_TIER.md] [--keep DIR]
                        [--effect EFFECT ...] [--drawn-sigmas]

Campaign by campaign: `lobestone simulate --random TIER --seed S`, `lobestone diagnose --json`, verdict against truth. Tiers
are those of `lobestone simulate --help`: controls, faint effects, foreign physics, the mixture that the confidence is
tried on (`trial`), the laboratory, three effects at once. `--effect` hides the effects named in turn in campaigns of all
kinds instead (force records where the first is one on cutting forces), at their usual sizes or, with `--drawn-sigmas`, from
barely visible to plain. `--loops` goes on with `add` until nothing is found. Writes a report (confusion matrix, false alarms,
misses by how plainly the effect shows, calibration of the confidence, time), next to it a CSV with one row a campaign and, where matplotlib is there, the reliability diagram. A CSV
that is there already is continued: campaigns in it are not run again, so a long run may be stopped and goes on.
"""

import argparse
import csv
import json
import math
import pathlib
import random
import resource
import statistics
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
FIELDS = [
    "seed", "kind", "truth", "site", "also", "hidden", "sigmas", "excess_chi2", "nearest_library_effect", "nearest_excess_chi2",
    "noise", "noise_kind", "verdict", "said", "said_site", "confidence", "companion", "indistinguishable", "loop", "outcome",
    "seconds",
]  # fmt: skip
TIERS = ["mixed", "control", "faint", "foreign", "trial", "laboratory", "three"]
# Upper ends of the classes of visibility, in standard deviations.
CLASSES = [10, 30, 100, 300, 1000, math.inf]
# Of measurement, for effects that are named.
KINDS = ["careful", "direct", "dirty"]
# Ends of the bins of the reliability diagram.
BINS = [0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0001]
# An effect that sticks out of the noise less than this may honestly be called absent.
VISIBLE_SIGMAS = 10
# Between which it is drawn how plainly an effect shows, standard deviations: as `simulate --random mixed` does.
VISIBILITY_SIGMAS = (5.0, 1000.0)
# A library effect that leaves no more than this share of what foreign physics does is as good a name as `unknown`.
EQUIVALENT_SHARE = 0.1
# Effects that a loop may add.
MOST_ADDED = 5


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--tier", choices=TIERS, default="mixed")
    arguments.add_argument("--count", type=int, default=50)
    arguments.add_argument("--first-seed", type=int, default=1000)
    arguments.add_argument("--lobestone", default=str(ROOT / "target/release/lobestone"))
    arguments.add_argument("--simulate-with", help="another lobestone that makes the campaigns, to try an older one on them")
    arguments.add_argument("--loops", action="store_true", help="diagnose, add what is named, and so on until nothing is")
    arguments.add_argument("--effect", action="append", default=[], help="hide this effect of the library instead (several: in turn)")
    arguments.add_argument("--drawn-sigmas", action="store_true", help="of such an effect draw how plainly it shows, as `mixed` does "
                           "(else: its usual sizes, which in some campaigns are not seen at all)")
    arguments.add_argument("--lines-hz", type=float, help="spacing of the spectral lines, to try this script quickly (default: as "
                           "simulate has it)")
    arguments.add_argument("--report", type=pathlib.Path, help="default: reports/diagnosis_TIER.md")
    arguments.add_argument("--keep", type=pathlib.Path, help="keep the campaigns in this folder")
    options = arguments.parse_args()
    options.report = options.report or default_report(options)
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
        print(f"{seed}: {row['hidden'] or row['truth']} {row['site']} {row['also']} -> {row['said']} {row['said_site']}: "
              f"{row['outcome']}, {row['confidence']}, {row['seconds']} s {row['loop']}", flush=True)
    if not rows:
        raise SystemExit("no campaigns: --count must be above zero")
    rows.sort(key=lambda r: int(r["seed"]))
    text = report(rows, options)
    temporary = options.report.with_suffix(".tmp")
    temporary.write_text(text)
    temporary.replace(options.report)
    picture(rows, options.report.with_suffix(".png"))
    print(f"wrote {options.report} and {table}")


def default_report(options):
    name = "confusion" if options.tier == "mixed" else options.tier
    if options.effect:
        name = "effects"
    parts = ["diagnosis", name, "loops" if options.loops else ""]
    return ROOT / "reports" / ("_".join(p for p in parts if p) + ".md")


def known(table):
    if not table.exists():
        return []
    with table.open(newline="") as file:
        # Tables of earlier versions have fewer columns.
        return [dict.fromkeys(FIELDS, "") | row for row in csv.DictReader(file)]


def write_rows(table, rows, fields=FIELDS):
    temporary = table.with_suffix(".csv.tmp")
    with temporary.open("w", newline="") as file:
        writer = csv.DictWriter(file, fields)
        writer.writeheader()
        writer.writerows(rows)
    temporary.replace(table)


def lobestone(program, *arguments):
    run = subprocess.run([program, *arguments, "--json"], capture_output=True, text=True)
    if run.returncode != 0:
        raise SystemExit(f"lobestone {' '.join(arguments)} failed:\n{run.stderr}")
    return json.loads(run.stdout)


def processor_time():
    """Of the programs that were run, s: unlike time on the clock, not longer on a busy machine."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def simulated(options, seed, folder):
    """Folder and truth of one campaign."""
    name = str(folder / f"campaign-{seed}")
    tier = [] if options.tier == "mixed" else [options.tier]
    spacing = ["--lines-hz", str(options.lines_hz)] if options.lines_hz else []
    what = ["--random", *tier]
    if options.effect:
        turn = seed - options.first_seed
        effect = options.effect[turn % len(options.effect)]
        what = ["--effect", effect, "--kind", KINDS[turn // len(options.effect) % len(KINDS)]]
        if options.drawn_sigmas:
            draw = random.Random(f"sigmas {seed}")
            sigmas = math.exp(draw.uniform(*map(math.log, VISIBILITY_SIGMAS)))
            what += ["--visibility", f"{sigmas:.3g}", "--possible"]
        if effect.startswith("amplitude"):
            what += ["--force-levels", "200,50"]
    written = lobestone(options.simulate_with or options.lobestone, "simulate", "--out", name, "--seed", str(seed), *spacing, *what)
    return written["dir"], json.loads(pathlib.Path(written["truth"]).read_text())


def added_until_quiet(options, folder):
    """What a loop of diagnose and add names, in order, and the last diagnosis."""
    added = []
    while True:
        found = lobestone(options.lobestone, "diagnose", folder)
        if found["verdict"] != "effect" or len(added) == MOST_ADDED:
            return added, found
        name = label(found["effect"], found["site"])
        lobestone(options.lobestone, "add", folder, name)
        added.append(name)


def one(options, seed):
    with tempfile.TemporaryDirectory() as scratch:
        folder = options.keep or pathlib.Path(scratch)
        folder.mkdir(parents=True, exist_ok=True)
        campaign, truth = simulated(options, seed, folder)
        started = processor_time()
        if options.loops:
            added, found = added_until_quiet(options, campaign)
        else:
            added, found = [], lobestone(options.lobestone, "diagnose", campaign)
        seconds = processor_time() - started
    others = [label(a["effect"], a["site"]) for a in truth["also"]]
    nearest = truth.get("nearest_library_effect") or {}
    visible = truth.get("visibility") or {}
    # With several effects the campaign is as plain as the plainest one.
    seen = [v["sigmas"] for v in [visible, *(a.get("visibility") for a in truth["also"])] if v]
    # Force records have their noise in newtons.
    noise = truth.get("noise") or [truth["noise_n"]]
    kinds = [truth.get("line_noise", "white")] + (["common"] if truth.get("common_noise") else [])
    row = {
        "seed": seed,
        "kind": truth.get("kind", truth.get("domain", "")),
        "truth": truth["effect"],
        "site": truth["site"] or "",
        "also": " ".join(others),
        "hidden": truth["parameters"].get("kind", "") if truth["effect"] == "unknown" else "",
        # Force records do not say how plainly their effect shows.
        "sigmas": f"{max(seen):.1f}" if seen else "inf" if truth.get("domain") == "cutting" else "",
        "excess_chi2": f"{visible['excess_chi2_per_value']:.3g}" if "excess_chi2_per_value" in visible else "",
        "nearest_library_effect": nearest.get("effect") or "",
        "nearest_excess_chi2": f"{nearest['excess_chi2_per_value']:.3g}" if nearest else "",
        "noise": f"{noise[0]:.4f}",
        "noise_kind": " ".join(kinds),
        "verdict": found["verdict"],
        "said": found["effect"] or found["verdict"],
        "said_site": found["site"] or "",
        "confidence": f"{found['confidence']:.3f}",
        "companion": found.get("companion") or "",
        "indistinguishable": " ".join(found["indistinguishable"]),
        "loop": " ".join(added),
        "seconds": f"{seconds:.1f}",
    }
    row["outcome"] = loop_outcome(row) if options.loops else outcome(row)
    return row


def label(effect, site):
    return f"{effect}@{site}" if site else effect


def outcome(row):
    """What became of one campaign. Only `right` counts as right in the calibration of the confidence."""
    # Physics without a name has a place, but `unknown` names none.
    true = label(row["truth"], row["site"] if row["truth"] != "unknown" else "")
    said = label(row["said"], row["said_site"])
    truths = {true, *row["also"].split()}
    if said in truths:
        return "right"
    if row["truth"] == "none":
        # `unknown` at nothing hidden is an alarm as well; it names nothing.
        return "false alarm"
    if row["truth"] == "unknown" and is_equivalent(row, said):
        return "near-equivalent"
    if row["said"] == "none":
        return "missed"
    if row["said"] == "unknown":
        return "not named"
    if row["said"] in {t.split("@")[0] for t in truths}:
        return "wrong site"
    if truths & set(row["indistinguishable"].split()):
        return "named as indistinguishable"
    return "wrong effect"


def is_equivalent(row, said):
    """Whether the name said is the library's best imitation of foreign physics, and hardly to be told from it."""
    if not row["nearest_excess_chi2"] or not row["excess_chi2"]:
        return False
    left = float(row["nearest_excess_chi2"]) / float(row["excess_chi2"])
    return said == row["nearest_library_effect"] and left <= EQUIVALENT_SHARE


def loop_outcome(row):
    """A loop is right if it ends in `none` with just what was hidden."""
    true = {label(row["truth"], row["site"]), *row["also"].split()} - {"none"}
    named = set(row["loop"].split())
    if row["said"] == "none" and named == true:
        return "right"
    if named - true:
        return "wrong effect"
    return "not all found" if true - named else f"ends in {row['said']}"


def is_right(row):
    return row["outcome"] in ("right", "near-equivalent")


def confidently_wrong(row):
    return row["verdict"] == "effect" and not is_right(row) and float(row["confidence"]) >= 0.8


def picture(rows, path):
    """Reliability diagram: the share that is right against the confidence said, 95 % intervals; below, how often."""
    try:
        import matplotlib
    except ImportError:
        print("no matplotlib: no picture of the confidence")
        return
    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure, (above, below) = pyplot.subplots(2, 1, figsize=(5, 6), height_ratios=[3, 1], sharex=True)
    above.plot([0, 1], [0, 1], color="0.7", zorder=0)
    for low, high in zip(BINS, BINS[1:]):
        mine = [r for r in rows if low <= float(r["confidence"]) < high]
        if not mine:
            continue
        said = statistics.mean(float(r["confidence"]) for r in mine)
        right = sum(is_right(r) for r in mine)
        low_share, high_share = wilson(right, len(mine))
        above.errorbar(said, right / len(mine), [[right / len(mine) - low_share], [high_share - right / len(mine)]],
                       fmt="o", color="C0", capsize=3)
        below.bar(low, len(mine), width=min(high, 1) - low, align="edge", color="C0", edgecolor="white")
    above.set(ylabel="share right, 95 %", ylim=(0, 1.02), xlim=(0, 1))
    below.set(xlabel="confidence said", ylabel="campaigns")
    figure.tight_layout()
    figure.savefig(path, dpi=120, metadata={"Software": None})
    pyplot.close(figure)


def wilson(hits, count, z=1.96):
    """95 % interval of a share (Wilson 1927)."""
    if count == 0:
        return 0.0, 1.0
    share = hits / count
    centre = share + z * z / (2 * count)
    half = z * math.sqrt(share * (1 - share) / count + z * z / (4 * count * count))
    scale = 1 + z * z / count
    # Rounding must not leave 0..1, nor the share outside.
    return min(share, max(0.0, (centre - half) / scale)), max(share, min(1.0, (centre + half) / scale))


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


def brier(rows):
    return statistics.mean((float(r["confidence"]) - is_right(r)) ** 2 for r in rows)


def calibration(rows):
    body = []
    for low, high in zip(BINS, BINS[1:]):
        mine = [r for r in rows if low <= float(r["confidence"]) < high]
        if mine:
            right = sum(is_right(r) for r in mine)
            said = statistics.mean(float(r["confidence"]) for r in mine)
            low_share, high_share = wilson(right, len(mine))
            fits = "yes" if low_share <= said <= high_share else "NO"
            body.append([f"{low:.2f}–{min(high, 1):.2f}", f"{said:.2f}", share(right, len(mine)), fits])
    confidences = [float(r["confidence"]) for r in rows]
    hits = [is_right(r) for r in rows]
    visible = [r for r in rows if r["truth"] == "none" or float(r["sigmas"]) >= VISIBLE_SIGMAS]
    summary = (f"\nOver all: mean confidence {statistics.mean(confidences):.3f}, right {statistics.mean(hits):.3f}; "
               f"Brier score {brier(rows):.3f} (0 is perfect, 0.25 is a coin).\n")
    if visible:
        summary += (f"Without what stands out by less than {VISIBLE_SIGMAS} standard deviations, which a perfect test would often "
                    f"miss: {len(visible)} campaigns, right {statistics.mean(map(is_right, visible)):.3f}, "
                    f"Brier score {brier(visible):.3f}.\n")
    return markdown(["confidence", "mean said", "right", "said within the interval"], body) + summary


def report(rows, options):
    count = len(rows)
    right = sum(is_right(r) for r in rows)
    none = [r for r in rows if r["truth"] == "none"]
    unknown = [r for r in rows if r["truth"] == "unknown"]
    effects = [r for r in rows if r["truth"] not in ("none", "unknown")]
    plain = [r for r in effects if float(r["sigmas"]) >= VISIBLE_SIGMAS]
    two = [r for r in effects if r["also"]]
    seconds = [float(r["seconds"]) for r in rows]
    spacing = f" --lines-hz {options.lines_hz}" if options.lines_hz else ""
    spacing += " --loops" if options.loops else ""
    name = options.report.with_suffix(".csv").name
    rate = lambda part, what: share(sum(r["outcome"] == what for r in part), len(part))  # noqa: E731
    figures = [
        ["right (effect and site, none, or unknown)", share(right, count)],
        [f"right where the effect stands out by {VISIBLE_SIGMAS} standard deviations or more", rate(plain, "right")],
        ["false alarms on campaigns with nothing hidden", rate(none, "false alarm")],
        ["effects missed (said none)", rate(effects, "missed")],
        ["wrong site of the right effect", rate(effects, "wrong site")],
        ["wrong effect, but the right one named as indistinguishable", rate(effects, "named as indistinguishable")],
        ["physics outside the library called unknown, or by a name hardly to be told from it",
         share(sum(is_right(r) for r in unknown), len(unknown))],
        ["a wrong name with confidence 0.8 or more", share(sum(map(confidently_wrong, rows)), count)],
        ["several effects: one of them named", rate(two, "right")],
    ] + [[f"right on {kind} campaigns", rate([r for r in rows if r["kind"] == kind], "right")]
         for kind in sorted({r["kind"] for r in rows})]
    wrong = [[r["seed"], r["kind"], " + ".join([label(r["hidden"] or r["truth"], r["site"]), *r["also"].split()]), r["sigmas"],
              label(r["said"], r["said_site"]), r["confidence"], r["outcome"]]
             for r in rows if not is_right(r)]
    if options.effect:
        hidden = " \\\n  ".join(f"--effect {effect}" for effect in options.effect) + " --drawn-sigmas" * options.drawn_sigmas
        sizes = "how plainly it shows is drawn" if options.drawn_sigmas else "at its usual sizes"
        how = f"`lobestone simulate --effect` hides one effect after the other, {sizes};\nrobot, postures and noise are drawn"
    else:
        hidden = f"--tier {options.tier}"
        how = (f"`lobestone simulate --random {options.tier}` draws kind, postures, robot, noise, what is hidden and how plainly\n"
               "it shows")
    written = "" if options.report == default_report(options) else f" \\\n  --report reports/{options.report.name}"
    return f"""# Diagnosis of random campaigns

Made by

```sh
python3 scripts/random_campaigns.py {hidden} --count {options.count} --first-seed {options.first_seed}{spacing}{written}
```

{count} campaigns, seeds {options.first_seed} to {options.first_seed + options.count - 1}; one row a campaign in
[{name}]({name}). {how}; `lobestone diagnose` sees the folder only. Library effects are made with the model that is fitted to them. Intervals are 95 % (Wilson).

{markdown(["", ""], figures)}
Processor time of `diagnose`: median {statistics.median(seconds):.1f} s, longest {max(seconds):.1f} s.

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
