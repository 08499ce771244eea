#!/usr/bin/env python3
"""Side by side with sdypy-EMA (PyPI: `pip install sdypy-EMA`), in one run on the same files.

    cargo build --release --no-default-features --features program --bins --bench modal && python3 scripts/compare_sdypy_ema.py

Makes robot-like sets of FRFs (seven modes from 6 to 60 Hz, two of them closer than their widths, 12 responses at 3
references), with and without noise, and prints the errors of both programs and the time both take.

sdypy-EMA is given what it needs and lobestone finds by itself: the approximate frequencies of the modes. "time" is, for
both, that of the computation alone, from FRFs in memory to modes in memory (`benches/modal.rs`; both are warm);
"process" is that of `lobestone modal` from start to exit, reading the text file and printing JSON included. Every time is
the fastest of three runs (other programs on the machine only make a run slower), the median over the draws.

usage: python3 scripts/compare_sdypy_ema.py [path of the lobestone binary]
"""

import contextlib
import io
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from sdypy import EMA

POLES = [(6.4, 0.03), (8.2, 0.028), (13.8, 0.03), (14.05, 0.0256), (19.3, 0.025), (33.0, 0.02), (56.0, 0.018)]
RESPONSES, REFERENCES = 12, 3
DRAWS = 5
ROOT = Path(__file__).resolve().parent.parent


def make(noise, seed):
    fixed = np.random.default_rng(4)
    shape = fixed.uniform(0.3, 1, (len(POLES), RESPONSES)) * fixed.choice([-1, 1], (len(POLES), RESPONSES))
    random = np.random.default_rng(seed)
    f = np.arange(0.25, 70.0 + 1e-9, 0.25)
    w = 2 * np.pi * f
    h = np.zeros((RESPONSES, REFERENCES, f.size), complex)
    for (f0, zeta), phi in zip(POLES, shape):
        w0 = 2 * np.pi * f0
        h += 0.005 * np.outer(phi, phi[:REFERENCES])[:, :, None] / (w0**2 - w**2 + 2j * zeta * w0 * w)
    e = random.standard_normal(h.shape) + 1j * random.standard_normal(h.shape)
    return f, h + noise * abs(h) * e / np.sqrt(2)


def write_csv(path, f, h):
    names, columns = ["frequency_hz"], [f]
    for i in range(RESPONSES):
        for j in range(REFERENCES):
            dofs = f"{i // 3 + 1}{'XYZ'[i % 3]}/{j // 3 + 1}{'XYZ'[j % 3]}"
            names += [f"re({dofs})", f"im({dofs})"]
            columns += [h[i, j].real, h[i, j].imag]
    np.savetxt(path, np.array(columns).T, delimiter=",", header=",".join(names), comments="", fmt="%.17g")


def fastest(run, *arguments):
    """What `run` returns with its time, of the fastest of three runs."""
    return min((run(*arguments) for _ in range(3)), key=lambda found: found[1])


def lobestone(binary, path):
    # To a file: reading a pipe would be part of the time.
    with tempfile.TemporaryFile() as out:
        began = time.perf_counter()
        subprocess.run([binary, "--json", "modal", "--band", "3:70", path], stdout=out, stderr=subprocess.DEVNULL, check=True)
        took = time.perf_counter() - began
        out.seek(0)
        return [(m["frequency_hz"], m["damping_ratio"]) for m in json.load(out)["global"]], took


def computation(paths):
    """Seconds of the computation alone for each file."""
    built = sorted((ROOT / "target/release/deps").glob("modal-*"), key=lambda p: p.stat().st_mtime)
    built = [p for p in built if p.suffix == "" and p.stat().st_mode & 0o111]
    if not built:
        sys.exit("no bench: run `cargo build --release --no-default-features --features program --bench modal` first")
    return json.loads(subprocess.run([built[-1], "--seconds-json", *paths], stdout=subprocess.PIPE, check=True).stdout)


def sdypy(f, h):
    frf = h.reshape(-1, f.size)
    began = time.perf_counter()
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        model = EMA.Model(frf, f, lower=3, upper=70, pol_order_high=60, frf_type="receptance")
        model.get_poles()
        # Its defaults (50 Hz windows, 0.1 % and 5 %) are for modes in the kilohertz.
        model.select_closest_poles([p[0] for p in POLES], f_window=1, fn_temp=0.01, xi_temp=0.1)
        model.get_constants()
    took = time.perf_counter() - began
    return list(zip(model.nat_freq, model.nat_xi)), took


def errors(found):
    """Largest and median relative errors in f and ζ over the modes, per cent; None where a mode is missing."""
    found = sorted(found)
    if len(found) != len(POLES):
        return None
    off = 100 * abs(np.array(found) / np.array(POLES) - 1)
    return [*off.max(axis=0), *np.median(off, axis=0)]


def main():
    binary = sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "target/release/lobestone")
    print(f"{len(POLES)} modes, {RESPONSES}x{REFERENCES} FRFs, 0.25 Hz lines; largest and median error over the modes, mean of draws")
    print(f"{'noise':>6} {'program':>10} {'f %':>9} {'zeta %':>9} {'median f %':>11} {'zeta %':>9} {'time s':>8} {'process s':>10} {'sets with all modes':>20}")
    ratios, process_ratios = [], []
    with tempfile.TemporaryDirectory() as folder:
        for noise in (0.0, 0.02, 0.05):
            sets = [make(noise, seed) for seed in range(DRAWS)]
            paths = [f"{folder}/set{k}.csv" for k in range(DRAWS)]
            for path, (f, h) in zip(paths, sets):
                write_csv(path, f, h)
            # One program after the other: the threads of NumPy's linear algebra go on spinning for a while.
            ours = [fastest(lobestone, binary, path) for path in paths]
            alone = computation(paths)
            theirs = [fastest(sdypy, f, h) for f, h in sets]
            time.sleep(1)
            times = {"lobestone": np.median(alone), "sdypy-EMA": np.median([t for _, t in theirs])}
            process = np.median([t for _, t in ours])
            for name, found in (("lobestone", ours), ("sdypy-EMA", theirs)):
                whole = [e for e in (errors(modes) for modes, _ in found) if e is not None]
                mean = np.mean(whole, axis=0) if whole else [np.nan] * 4
                shown = f"{process:10.3f}" if name == "lobestone" else f"{'':10}"
                print(f"{100 * noise:5.0f}% {name:>10} {mean[0]:9.4f} {mean[1]:9.3f} {mean[2]:11.4f} {mean[3]:9.3f} {times[name]:8.3f} {shown} {len(whole):>14} of {DRAWS}")
            ratios.append(times["sdypy-EMA"] / times["lobestone"])
            process_ratios.append(times["sdypy-EMA"] / process)
    print("time ratio sdypy-EMA / lobestone:", ", ".join(f"{r:.1f}" for r in ratios))
    print("time ratio sdypy-EMA / whole process of lobestone:", ", ".join(f"{r:.1f}" for r in process_ratios))


if __name__ == "__main__":
    main()
