#!/usr/bin/env python3
"""`lobestone modal` side by side with sdypy-EMA on measured sets of FRFs, in one run on the same files.

    cargo build --release --no-default-features --features program --bins && python3 scripts/compare_real_sets.py \\
        [--binary PATH] [--band FROM:TO] [--order N] SET.uff ...        (pip install pyuff numpy sdypy-EMA)

Each file is one set (UFF 58). sdypy-EMA gets what it needs and lobestone finds by itself: the approximate frequencies,
those that lobestone found. Its time is that of the LSCF poles up to `--order` and of the residues (LSFD), warm, from FRFs
in memory; lobestone's is the whole process, with reading the file and printing JSON. Both are processor times, of all
threads; sdypy-EMA's linear algebra runs on one thread, so that idle spinning is not counted.

Printed per set: FRFs × lines, modes that lobestone found, how many of them sdypy-EMA has too (nearest pole of its highest
order within both half-widths), lobestone's verdict, what it listed as no mode, both processor times, their ratio and
lobestone's memory.
"""

import argparse
import contextlib
import io
import json
import os
import resource
import subprocess
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np
from sdypy import EMA

from split_coverage import datasets


def read(path):
    found = datasets(path)
    return np.asarray(found[0]["x"]), np.array([d["data"] for d in found])


def lobestone(binary, path, band):
    command = [binary, "--json", "modal", "--quiet", str(path)] + (["--band", band] if band else [])
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
    out = run.stdout.read()
    _, status, usage = os.wait4(run.pid, 0)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if status:
        raise SystemExit(f"{' '.join(command)}: failed")
    spent = (after.ru_utime + after.ru_stime) - (before.ru_utime + before.ru_stime)
    return json.loads(out), spent, usage.ru_maxrss / 1024


def sdypy(f, h, band, order, near):
    low, high = band
    began = time.process_time()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        model = EMA.Model(h, f, lower=low, upper=high, pol_order_high=order, frf_type="accelerance")
        model.get_poles()
        # Its defaults (50 Hz windows, 0.1 % and 5 %) leave modes out.
        model.select_closest_poles(near, f_window=max(2.0, 0.02 * high), fn_temp=0.01, xi_temp=0.1)
        model.get_constants()
    spent = time.process_time() - began
    last = np.asarray(model.all_poles[-1])
    return np.abs(last) / (2 * np.pi), -np.real(last) / np.abs(last), spent


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--binary", default=str(Path(__file__).resolve().parent.parent / "target/release/lobestone"))
    parser.add_argument("--band", help="FROM:TO, Hz")
    parser.add_argument("--order", type=int, default=80)
    parser.add_argument("sets", nargs="+", type=Path)
    arguments = parser.parse_args()
    print(
        f"{'set':28} {'FRFs x lines':>14} {'modes':>6} {'both':>5} {'no mode':>8} {'verdict':>9} "
        f"{'ours s':>8} {'sdypy s':>8} {'ratio':>6} {'MB':>6}"
    )
    for path in arguments.sets:
        f, h = read(path)
        band = arguments.band
        low, high = map(float, band.split(":")) if band else (f[f > 0][0], f[-1])
        found, ours, memory = lobestone(arguments.binary, path, band)
        near = [m["frequency_hz"] for m in found["global"]]
        fs, zs, theirs = sdypy(f, h, (low, high), arguments.order, near)
        both = 0
        for mode in found["global"]:
            width = mode["frequency_hz"] * mode["damping_ratio"]
            near_poles = np.abs(fs - mode["frequency_hz"]) < width + np.abs(zs * fs)
            both += bool(np.any(near_poles & (zs > 0) & (zs < 0.2)))
        print(
            f"{path.name:28} {len(h):5} x {len(f):6} {len(near):6} {both:5} {len(found['rejected']):8} "
            f"{found['quality']['verdict']:>9} {ours:8.2f} {theirs:8.2f} {theirs / ours:6.1f} {memory:6.0f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
