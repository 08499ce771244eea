#!/usr/bin/env python3
"""Output-only analysis side by side with pyOMA2 (PyPI: `pip install pyOMA-2`), in one run on the same records.

    cargo build --release --no-default-features --features program --bins && python3 scripts/compare_pyoma2.py

Makes records of five accelerations of a structure (five modes from 7 to 33 Hz, two of them close) under random forces,
without and with a spindle's harmonics, and prints what both programs find and the time both take. pyOMA2 is given what
lobestone finds by itself: the record thinned to the band, and the approximate frequencies of the modes. "process" is
`lobestone modal` from start to exit, reading the text file and all standard deviations included; pyOMA2's time is that of
`run_by_name` and `mpe` alone, without standard deviations, and once with them (`calc_unc`).

usage: python3 scripts/compare_pyoma2.py [path of the lobestone binary]
"""

import json
import logging
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy import signal

logging.disable(logging.CRITICAL)
from pyoma2.algorithms import SSIcov  # noqa: E402
from pyoma2.setup import SingleSetup  # noqa: E402

MODES = [(7.1, 0.03), (11.4, 0.02), (12.0, 0.025), (21.5, 0.015), (33.0, 0.02)]
POINTS, RATE_HZ, LENGTH_S = 5, 256, 240
SPINDLE_HZ = 9.37
ROOT = Path(__file__).resolve().parent.parent


def make(seed, spindle):
    random = np.random.default_rng(seed)
    n = RATE_HZ * LENGTH_S
    force = random.standard_normal((n, POINTS))
    out = np.zeros((n, POINTS))
    for m, (f, zeta) in enumerate(MODES):
        shape = np.sin(np.pi * (m + 1) * np.arange(1, POINTS + 1) / (POINTS + 1))
        w = 2 * np.pi * f
        system = signal.cont2discrete(([[0, 1], [-w * w, -2 * zeta * w]], [[0], [1]], [[-w * w, -2 * zeta * w]], [[1]]), 1 / RATE_HZ)
        numerator, denominator = signal.ss2tf(*system[:4])
        out += np.outer(signal.lfilter(numerator[0], denominator, force @ shape), shape)
    out += 0.3 * random.standard_normal(out.shape)
    if spindle:
        t = np.arange(n)[:, None] / RATE_HZ
        for k, size in ((1, 6.0), (2, 3.0), (3, 3.0)):
            out += size * np.sin(2 * np.pi * k * SPINDLE_HZ * t + np.arange(POINTS))
    return out


def ours(binary, data, folder):
    path = Path(folder) / "record.csv"
    t = np.arange(len(data)) / RATE_HZ
    names = ",".join(["time_s"] + [f"a{k}_m_s2" for k in range(POINTS)])
    np.savetxt(path, np.column_stack([t, data]), delimiter=",", header=names, comments="", fmt="%.9g")
    command = [binary, "modal", str(path), "--output-only", "--band", "2:50", "--json"]
    start = time.perf_counter()
    result = subprocess.run(command, capture_output=True, text=True, check=True)
    return json.loads(result.stdout)["output_only"][0], time.perf_counter() - start


def theirs(data, uncertainty):
    start = time.perf_counter()
    setup = SingleSetup(signal.decimate(data, 2, axis=0, ftype="fir"), RATE_HZ / 2)
    method = SSIcov(name="ssi", br=30, ordmax=60, **({"calc_unc": True} if uncertainty else {}))
    setup.add_algorithms(method)
    setup.run_by_name("ssi")
    setup.mpe("ssi", sel_freq=[f for f, _ in MODES], order_in=40)
    return method.result.Fn, method.result.Xi, time.perf_counter() - start


def main():
    binary = sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "target/release/lobestone")
    with tempfile.TemporaryDirectory() as folder:
        for spindle in (False, True):
            data = make(1 if spindle else 0, spindle)
            found, seconds = ours(binary, data, folder)
            frequency, damping, plain = theirs(data, False)
            try:
                with_deviations = theirs(data, True)[2]
            except Exception as error:  # another version may have no such thing
                with_deviations = float("nan")
                print(f"pyOMA2 without standard deviations: {error}")
            print(f"\n{'with' if spindle else 'without'} a spindle at {SPINDLE_HZ} Hz")
            print("  truth Hz    %   lobestone Hz            %              pyOMA2 Hz     %")
            for (f, zeta), fp, zp in zip(MODES, frequency, damping):
                near = [m for m in found["modes"] if abs(m["frequency_hz"] / f - 1) < 0.02]
                own = min(near, key=lambda m: abs(m["frequency_hz"] - f), default=None)
                text = "–" if own is None else (
                    f"{own['frequency_hz']:7.3f} ± {own['frequency_std_hz']:.3f}  "
                    f"{100 * own['damping_ratio']:5.2f} ± {100 * own['damping_std']:.2f}")
                print(f"  {f:6.2f} {100 * zeta:5.2f}   {text:34}  {fp:7.3f} {100 * zp:6.2f}")
            extra = len(found["modes"]) - len(MODES)
            lines = ", ".join(f"{h['frequency_hz']:.2f}" for h in found["harmonics"])
            print(f"  lobestone: {extra:+d} modes besides the true ones; lines told: {lines or 'none'}")
            print(f"  time: lobestone process {seconds:.2f} s; pyOMA2 {plain:.2f} s, with standard deviations "
                  f"{with_deviations:.2f} s")


if __name__ == "__main__":
    main()
