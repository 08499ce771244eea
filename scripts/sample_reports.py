#!/usr/bin/env python3
"""Writes the sample reports in reports/ from the campaigns in datasets/campaigns.

    python3 scripts/sample_reports.py [--program target/release/lobestone] [NAME…]

Each sample is a folder:

report.html, *.png   what the program wrote: `lobestone report` (most with --static), or `lobestone thesis --out`
loop.txt             the commands that led there, and what they printed
summary.json         key numbers of these commands (`--json`), rounded to four significant digits

tests/integration/sample_reports.rs runs the commands of summary.json and loop.txt again and fails where the program
says something else. What it compares stands in summary.json only, so a new number is added here and nowhere else.
Only the standard library is used.
"""

import argparse
import json
import pathlib
import shutil
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent
ERROR = ["error/nrms", "error/noise_floor_nrms"]
HELD_OUT = ERROR + ["error/held_out_nrms"]
VERDICT = ["verdict", "effect", "site", "confidence", "baseline/nrms", "baseline/noise_floor_nrms", "baseline/held_out_nrms"]
JOINTS = [f"joint-{k}.stiffness" for k in range(1, 7)] + ["damping-ratio"]
COEFFICIENTS = ["ktc_n_per_mm2", "krc_n_per_mm2", "kac_n_per_mm2", "kte_n_per_mm", "kre_n_per_mm", "kae_n_per_mm"]


# Samples whose page answers to the mouse; the others are for reading and stay small.
INTERACTIVE = ["hidden-effect"]


def estimates(names, under="parameters"):
    return [f"{under}/{name}/{key}" for name in names for key in ("value", "std_error")]


def candidates(*effects):
    return [f"candidates/{effect}/{key}" for effect in effects for key in ("nrms", "held_out_nrms")]


def modes(count):
    """The first modes of the campaign: measured and of the model, side by side."""
    keys = ("posture", "measured_hz", "model_hz", "measured_damping", "model_damping", "mac")
    return [f"modes/{k}/{key}" for k in range(count) for key in keys]


# Per sample: its campaign, then the steps: arguments after `lobestone`, and which numbers of its document to keep.
# A path goes through objects by key, and through lists by position or by the name of an entry.
SAMPLES = {
    "thesis": (
        None,
        [
            (
                ["thesis", "--out", "page"],
                ["fitted_frequency_error", "predicted_frequency_error"]
                + estimates(JOINTS)
                + [f"frequencies/{k}/{key}" for k in range(8) for key in ("published_model", "measured", "before", "after")]
                + [
                    f"static_stiffness/{k}/{key}"
                    for k in range(6)
                    for key in ("published_model", "measured", "before", "after")
                ]
                + [
                    f"lobes/{k}/{source}/{region}/{key}"
                    for k in range(4)
                    for source in ("from_measurements", "from_model_after")
                    for region in ("second_region", "first_region")
                    for key in ("spindle_rpm", "depth_mm")
                ]
                + [f"unexplained/{k}/{key}" for k in range(2) for key in ("from_hz", "to_hz", "minima", "nearest_model_hz")]
                + ["real_case/verdict", "real_case/confidence"]
                + [f"real_case/candidates/0/{key}" for key in ("name", "delta_bic", "met", "weight")],
            )
        ],
    ),
    "hidden-effect": (
        "second-cell",
        [
            (["calibrate", "second-cell"], ["converged", "error_before/nrms"] + ERROR + estimates(JOINTS)),
            (
                ["diagnose", "second-cell"],
                VERDICT + candidates("tool-flexibility", "payload", "joint-damping", "time-delay") + ["explains/share"],
            ),
            (
                ["add", "second-cell", "tool-flexibility"],
                HELD_OUT
                + estimates(
                    JOINTS + [f"tool-flexibility.{k}" for k in ("mass_kg", "frequency_hz", "damping_ratio")],
                ),
            ),
            (["compare", "second-cell"], HELD_OUT + modes(9)),
            (
                ["history", "second-cell"],
                [f"revisions/{k}/{key}" for k in range(2) for key in ("nrms", "held_out_nrms")] + ["noise_floor_nrms"],
            ),
        ],
    ),
    "milling-wear": (
        "milling-wear",
        [
            (["cfc", "milling-wear"], estimates(COEFFICIENTS, "pooled/0") + [f"r2/{k}" for k in "xyz"]),
            (["compare", "milling-wear"], HELD_OUT + [f"by_axis/{k}" for k in ("Fx", "Fy", "Fz")]),
            (["diagnose", "milling-wear"], VERDICT + candidates("tool-wear", "nonlinear-drift", "speed-dependence")),
            (
                ["add", "milling-wear", "tool-wear"],
                HELD_OUT + estimates(COEFFICIENTS + [f"tool-wear.growth[{k}]" for k in "tra"]),
            ),
            (["diagnose", "milling-wear"], VERDICT),
            (
                ["history", "milling-wear"],
                [f"revisions/{k}/{key}" for k in range(2) for key in ("nrms", "held_out_nrms")] + ["noise_floor_nrms"],
            ),
        ],
    ),
}


def at(document, path):
    """The value at a path. An entry of a list is found by position, or by any of its texts."""
    for key in path.split("/"):
        if isinstance(document, dict):
            document = document[key]
        elif key.isdigit():
            document = document[int(key)]
        else:
            document = next(entry for entry in document if key in entry.values())
    return document


def rounded(value):
    return float(f"{value:.4g}") if isinstance(value, float) else value


def run(program, arguments, folder):
    done = subprocess.run([program, *arguments], cwd=folder, capture_output=True, text=True, encoding="utf-8")
    if done.returncode != 0:
        raise SystemExit(f"{' '.join(arguments)}: {done.stderr}")
    return done.stdout


def write(program, name):
    campaign, steps = SAMPLES[name]
    out = ROOT / "reports" / name
    with tempfile.TemporaryDirectory() as work:
        # `add` changes the campaign: what it prints and its document come from two copies.
        folders = [pathlib.Path(work) / kind for kind in ("text", "json")]
        for folder in folders:
            folder.mkdir()
            if campaign:
                shutil.copytree(ROOT / "datasets/campaigns" / campaign, folder / campaign)
        loop, summary = "", []
        for arguments, paths in steps:
            loop += f"$ lobestone {' '.join(arguments)}\n{run(program, arguments, folders[0])}\n"
            document = json.loads(run(program, [*arguments, "--json"], folders[1]))
            summary.append(
                {"command": " ".join(arguments), "values": {path: rounded(at(document, path)) for path in paths}}
            )
        if campaign:
            kind = [] if name in INTERACTIVE else ["--static"]
            run(program, ["report", campaign, "--out", "page", *kind], folders[0])
        shutil.rmtree(out, ignore_errors=True)
        out.mkdir(parents=True)
        for file in sorted((folders[0] / "page").iterdir()):
            # Parquet tables (tables/) are for other programs; a build may lack them.
            if file.is_file():
                shutil.copy(file, out)
    (out / "loop.txt").write_text(loop, encoding="utf-8")
    text = json.dumps({"campaign": campaign, "steps": summary}, indent=1, ensure_ascii=False)
    (out / "summary.json").write_text(text + "\n", encoding="utf-8")
    size = sum(f.stat().st_size for f in out.iterdir())
    print(f"{name}: {size / 1e6:.2f} MB, {sum(len(s['values']) for s in summary)} numbers")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--program", type=pathlib.Path, default=ROOT / "target/release/lobestone")
    parser.add_argument("names", nargs="*", metavar="NAME", help=", ".join(SAMPLES))
    args = parser.parse_args()
    for name in args.names or SAMPLES:
        write(args.program.resolve(), name)


if __name__ == "__main__":
    main()
