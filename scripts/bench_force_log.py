#!/usr/bin/env python3
"""A long force log read by `lobestone inspect`, by `pandas.read_csv` (C engine), and by `polars.scan_csv` and `duckdb` where
they are installed, timed in one run.

    python3 scripts/bench_force_log.py [--mb 1000] [--repeat 3] [--lobestone PATH] [--keep FILE] [--cfc]

Makes the log itself: 10 kHz, time and four channels, DynoWare header, air before and after a cut. Prints the time (best of
the repeats), the throughput, the peak memory and the processor time (all cores; it says more on a busy machine) of each
program, and their ratios. The others only read; `inspect` reads and
looks for faults as well. Each run is a process of its own, start included for both. With --cfc the log is also the one
record of a campaign.
"""

import argparse
import importlib.util
import os
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent.parent
RATE = 10_000
PANDAS = (
    "import sys, pandas; t = pandas.read_csv(sys.argv[1], skiprows=[0, 1, 3], engine='c'); "
    "assert t.shape[1] == 5; print(len(t))"
)
# Every number read, nothing kept but sums.
OTHERS = {
    "polars": (
        "import sys, polars; n = ['t', 'fx', 'fy', 'fz', 'mz']; "
        "t = polars.scan_csv(sys.argv[1], has_header=False, skip_rows=4, new_columns=n); print(t.sum().collect())"
    ),
    "duckdb": (
        "import sys, duckdb; print(duckdb.sql(\"select sum(column0), sum(column1), sum(column2), sum(column3), sum(column4) \""
        "\"from read_csv('\" + sys.argv[1] + \"', header=false, skip=4)\"))"
    ),
}
CAMPAIGN = """schema = "lobestone/campaign/1"
name = "long log"
[tool]
kind = "endmill"
diameter_mm = 16.0
teeth = 4
helix_deg = 30.0
[[cut]]
id = "01"
file = "log.csv"
process = "milling"
spindle_rpm = 1200.0
feed_per_tooth_mm = 0.1
axial_depth_mm = 2.0
immersion = "slot"
"""


def make(file, megabytes):
    """Writes rows until the file is that long; returns its rows."""
    wanted, rows = megabytes * 1_000_000, 0
    total = wanted / 43
    random = np.random.default_rng(1)
    with open(file, "w") as out:
        out.write("DynoWare,made here\nSampling rate [Hz]:,10000\nTime,Fx,Fy,Fz,Mz\ns,N,N,N,Nm\n")
        while out.tell() < wanted:
            n = 200_000
            t = (rows + np.arange(n)) / RATE
            turn = 2 * np.pi * 20.0 * t
            in_cut = (t > 0.1 * total / RATE) & (t < 0.85 * total / RATE)
            force = [
                in_cut * (level + 0.3 * level * np.sin(4 * turn + k)) + random.normal(0, 4, n)
                for k, level in enumerate((-250.0, 400.0, 120.0, 9.0))
            ]
            table = np.column_stack([t, *force])
            np.savetxt(out, table, fmt="%.4f,%.3f,%.3f,%.3f,%.4f")
            rows += n
    return rows


def run(command):
    """Wall time in s, peak resident memory in MB and processor time in s of a process."""
    started = time.perf_counter()
    process = subprocess.Popen(command, stdout=subprocess.DEVNULL)
    _, status, usage = os.wait4(process.pid, 0)
    if status != 0:
        sys.exit(f"failed: {' '.join(command)}")
    return time.perf_counter() - started, usage.ru_maxrss / 1000, usage.ru_utime + usage.ru_stime


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mb", type=int, default=1000)
    parser.add_argument("--repeat", type=int, default=3)
    parser.add_argument("--lobestone", default=str(HERE / "target/release/lobestone"))
    parser.add_argument("--keep", help="keep the log in this file (used again where it exists)")
    parser.add_argument("--cfc", action="store_true")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        file = pathlib.Path(options.keep or f"{folder}/log.csv")
        if not file.exists():
            make(file, options.mb)
        size = file.stat().st_size / 1e6
        print(f"log: {size:.0f} MB")
        commands = {
            "pandas.read_csv": [sys.executable, "-c", PANDAS, str(file)],
            "lobestone inspect": [options.lobestone, "inspect", "--json", str(file)],
        }
        for name, program in OTHERS.items():
            if importlib.util.find_spec(name):
                commands[name] = [sys.executable, "-c", program, str(file)]
        if options.cfc:
            campaign = pathlib.Path(folder) / "campaign"
            campaign.mkdir()
            (campaign / "campaign.toml").write_text(CAMPAIGN)
            (campaign / "log.csv").hardlink_to(file)
            commands["lobestone cfc"] = [options.lobestone, "cfc", "--json", str(campaign)]
        results = {}
        for name, command in commands.items():
            runs = [run(command) for _ in range(options.repeat)]
            results[name] = (min(r[0] for r in runs), max(r[1] for r in runs), min(r[2] for r in runs))
            seconds, memory, busy = results[name]
            rate = f"{seconds:7.2f} s  {size / seconds:6.0f} MB/s"
            print(f"{name:18} {rate}  peak {memory:6.0f} MB  processor {busy:6.2f} s")
        pandas = results["pandas.read_csv"]
        ours = results["lobestone inspect"]
        print(f"inspect is {pandas[0] / ours[0]:.1f} times as fast as pandas and takes {ours[1] / pandas[1]:.2f} of its memory")
        for name in OTHERS.keys() & results.keys():
            print(f"{name} takes {results[name][0] / ours[0]:.2f} times as long as inspect, processor {results[name][2] / ours[2]:.2f}")


if __name__ == "__main__":
    main()
