#!/usr/bin/env python3
"""The lobe surface over the redundancy angle with numpy, timed against `benches/lobes.rs` in one run.

    cargo build --release --no-default-features --features program --bench lobes && python3 scripts/bench_lobes.py

A straightforward numpy version of the same task: 72 structures of 12 modes with cross FRFs, 3000 spindle speeds. On a
frequency grid it takes the eigenvalues of D Phi, turns every point with a positive real part into depth and speed on
each lobe, and interpolates each lobe's depth onto the speed grid; the least one counts. The Rust side solves along the
lobes to 1e-11 instead; the largest difference of the envelopes' absolute limits is printed as a check of the task.
"""

import argparse
import json
import pathlib
import subprocess
import time

import numpy as np

HERE = pathlib.Path(__file__).resolve().parent.parent
KTC, KRC, KAPPA, TEETH = 1014.2e6, 619.9e6, 1.178, 2


def modes(angle):
    """The same made-up robot as `surface_modes` in benches/lobes.rs."""
    i = np.arange(12.0)
    turn = np.radians(angle)
    f = 6.0 + 4.3 * i + np.sin(3.0 * i) + 0.5 * np.sin(turn + i)
    direction = 1.1 * i + turn
    scale = 2 * np.pi * f / np.sqrt(1.5e6 * (1.0 + i))
    return f, 0.01 + 0.002 * i, scale[:, None] * np.stack([np.cos(direction), np.sin(direction)], axis=1)


def envelope(f, zeta, shape, speeds, points):
    """Depth limit in mm at each speed (NaN: no limit), absolute limit in mm."""
    grid = np.geomspace(f[0] / 50.0, f[-1] * 4.0, points)
    w, wn = 2 * np.pi * grid[:, None], 2 * np.pi * f
    gain = 1.0 / (wn**2 - w**2 + 2j * zeta * wn * w)
    phi = np.einsum("ra,fr,rb->fab", shape, gain, shape)
    factor = -TEETH * KTC / (2 * np.tan(KAPPA))
    d = factor * np.array([[KRC / KTC, 1.0], [-1.0, KRC / KTC]])
    m = d @ phi
    mean = 0.5 * (m[:, 0, 0] + m[:, 1, 1])
    root = np.sqrt((0.5 * (m[:, 0, 0] - m[:, 1, 1])) ** 2 + m[:, 0, 1] * m[:, 1, 0])
    limits = np.full(len(speeds), np.inf)
    least = np.inf
    for branch in (mean + root, mean - root):
        positive = branch.real > 0
        depth = np.where(positive, 1e3 / (2 * np.where(positive, branch.real, 1.0)), np.inf)
        least = min(least, depth.min())
        epsilon = 2 * np.arctan2(branch.real, -branch.imag)
        # Stretches on which the branch limits.
        edges = np.flatnonzero(np.diff(positive.astype(int))) + 1
        for part in np.split(np.arange(points), edges):
            if not positive[part[0]] or len(part) < 2:
                continue
            for k in range(int(grid[part[-1]] * 60 / (TEETH * speeds[0])) + 1):
                n = 60 * grid[part] / (TEETH * (k + epsilon[part] / (2 * np.pi)))
                # A lobe turns back: its falling and its rising side one after the other.
                turns = np.flatnonzero(np.diff(np.sign(np.diff(n)))) + 1
                for side in np.split(np.arange(len(part)), turns):
                    if len(side) < 2:
                        continue
                    x, y = n[side], depth[part][side]
                    if x[0] > x[-1]:
                        x, y = x[::-1], y[::-1]
                    limits = np.fmin(limits, np.interp(speeds, x, y, left=np.inf, right=np.inf))
    return limits, least


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--points", type=int, default=4000, help="frequency grid of the numpy version")
    parser.add_argument("--angles", type=int, default=72)
    args = parser.parse_args()
    speeds = np.arange(3000) * 0.5 + 100.0

    command = ["cargo", "bench", "--no-default-features", "--features", "program", "--bench", "lobes", "--", "--surface-json"]
    ours = json.loads(subprocess.run(command, check=True, capture_output=True, text=True, cwd=HERE).stdout)

    start = time.perf_counter()
    least = []
    for i in range(args.angles):
        f, zeta, shape = modes(5.0 * i)
        least.append(envelope(f, zeta, shape, speeds, args.points)[1])
    numpy_s = (time.perf_counter() - start) * 72 / args.angles

    difference = np.max(np.abs(np.array(least) / np.array(ours["absolute_limit_mm"][: args.angles]) - 1))
    print(f"lobestone  {ours['seconds']:.3f} s  (72 angles x 3000 speeds, all threads)")
    print(f"numpy      {numpy_s:.3f} s  ({args.points} frequencies)")
    print(f"ratio      {numpy_s / ours['seconds']:.1f}; absolute limits differ by {100 * difference:.3f} % at most")


if __name__ == "__main__":
    main()
