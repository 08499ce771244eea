#!/usr/bin/env python3
"""Makes one ordinary laboratory mistake in each of many simulated campaigns and looks whether it is named.

    setup_mistakes.py [--count 20] [--kinds encoder-offset,axes,…] [--first-seed 1] [--lobestone target/release/lobestone]
                      [--command calibrate] [--table reports/setup_mistakes.csv] [--keep DIR]

A campaign is simulated without noise (tiers careful, direct and dirty in turn), damaged from the data or campaign.toml
alone, never with the model that looks for the damage, and only then given noise. Explicit seeds; a CSV that is there
already is continued. Kinds that this cannot make from data alone (sensor-mass away from the tool) are left to unit tests.
Needs numpy for exponential-window only (analytic continuation by the AAA algorithm, Nakatsukasa, Sète, Trefethen 2018).
"""

import argparse
import cmath
import csv
import json
import math
import pathlib
import random
import re
import tempfile
import time

from random_campaigns import lobestone, write_rows

ROOT = pathlib.Path(__file__).resolve().parent.parent
TIERS = ["careful", "direct", "dirty"]
NOISE = {"careful": (0.02, 1e-8), "direct": (0.03, 2e-8), "dirty": (0.10, 3e-8)}
FIELDS = ["seed", "tier", "kind", "where", "value", "said", "said_where", "said_value", "std_error", "confidence",
          "named", "within", "verdict", "seconds"]  # fmt: skip


def size(curves):
    """Root of the sum of squares of all values."""
    return math.sqrt(sum(abs(h) ** 2 for curve in curves.values() for h in curve))


class Campaign:
    """A simulated campaign in memory: text of campaign.toml and per posture the lines with {channel: [complex]}."""

    def __init__(self, folder):
        self.folder = folder
        self.toml = (folder / "campaign.toml").read_text()
        self.files = {}
        for path in sorted((folder / "frf").glob("*.csv")):
            with path.open(newline="") as file:
                header, *rows = csv.reader(file)
            names = [re.match(r"re\((.*)\)", name).group(1) for name in header[1::2]]
            lines = [float(row[0]) for row in rows]
            curves = {
                name: [complex(float(row[1 + 2 * i]), float(row[2 + 2 * i])) for row in rows]
                for i, name in enumerate(names)
            }
            self.files[path.stem] = (lines, curves)
        self.undamaged = {name: size(curves) for name, (_, curves) in self.files.items()}

    def change(self, posture, function):
        """function(channel, frequency, value) for every value of a posture (None: of all)."""
        for name, (lines, curves) in self.files.items():
            if posture in (None, name):
                for channel, curve in curves.items():
                    curves[channel] = [function(channel, f, h) for f, h in zip(lines, curve)]

    def add_noise(self, draw, relative, floor):
        for name, (lines, curves) in self.files.items():
            # In another quantity's units the floor is so many times larger or smaller as well.
            times = size(curves) / self.undamaged.get(name, size(curves))
            least = floor if 0.01 < times < 100.0 else floor * times
            for channel, curve in curves.items():
                scale = [math.hypot(relative * abs(h), least) for h in curve]
                curves[channel] = [
                    h + s * complex(draw.gauss(0, 1), draw.gauss(0, 1)) / math.sqrt(2) for h, s in zip(curve, scale)
                ]

    def write(self):
        (self.folder / "campaign.toml").write_text(self.toml)
        for name, (lines, curves) in self.files.items():
            with (self.folder / "frf" / f"{name}.csv").open("w", newline="") as file:
                writer = csv.writer(file)
                writer.writerow(["frequency_hz", *(p for c in curves for p in (f"re({c})", f"im({c})"))])
                for k, f in enumerate(lines):
                    writer.writerow([f, *(v for c in curves.values() for v in (repr(c[k].real), repr(c[k].imag)))])

    def angles(self, posture, joint, function):
        """Replaces angle `joint` (1-based) of a posture (None: of all) in campaign.toml."""

        def table(match):
            if posture not in (None, match.group(1)):
                return match.group(0)
            angles = [float(a) for a in match.group(2).split(",")]
            angles[joint - 1] = function(angles[joint - 1])
            return f'id = "{match.group(1)}"\njoints_deg = [{", ".join(f"{a:.6f}" for a in angles)}]'

        self.toml = re.sub(r'id = "(\w+)"\njoints_deg = \[(.*?)\]', table, self.toml)

    def position(self, node, shift):
        def table(match):
            position = [float(p) + s for p, s in zip(match.group(2).split(","), shift)]
            return f"{match.group(1)}position_m = [{', '.join(f'{p:.6f}' for p in position)}]"

        self.toml = re.sub(rf'(node = {node}\nbody = "\w+"\n)position_m = \[(.*?)\]', table, self.toml)


def ends(channel):
    response, reference = channel.split("/")
    return response, reference


def either(draw, low, high):
    return draw.choice([-1, 1]) * math.exp(draw.uniform(math.log(low), math.log(high)))


def encoder_offset(c, draw):
    joint = draw.randint(1, 6)
    offset = either(draw, 0.5, 3.0)
    posture = draw.choice([None, None, draw.choice(sorted(c.files))])
    c.angles(posture, joint, lambda a: a - offset)
    return f"joint {joint}" + (f", posture {posture}" if posture else ", all"), offset


def point_position(c, draw):
    node = draw.choice(sorted({int(ends(ch)[0][:-1]) for _, curves in c.files.values() for ch in curves}))
    shift = [draw.gauss(0, 1) for _ in range(3)]
    size = math.exp(draw.uniform(math.log(0.01), math.log(0.05))) / math.sqrt(sum(s * s for s in shift))
    c.position(node, [-size * s for s in shift])
    return f"node {node}", 1e3 * math.sqrt(sum((size * s) ** 2 for s in shift))


def axes(c, draw):
    """Sensor and hammer alike, or the sensor alone: a signed permutation of the names, in all files or one."""
    direct = all(ends(ch)[0] == ends(ch)[1] for _, curves in c.files.values() for ch in curves)
    posture = draw.choice([None, draw.choice(sorted(c.files))])
    if direct:
        to, sign, both = {"X": "Y", "Y": "X"}, {"X": 1, "Y": 1}, True
    else:
        order = draw.choice([("Y", "X", "Z"), ("Z", "Y", "X"), ("X", "Z", "Y"), ("Y", "Z", "X"), ("Z", "X", "Y")])
        to = dict(zip("XYZ", order))
        sign = {a: draw.choice([-1, 1]) for a in "XYZ"}
        both = draw.random() < 0.5
    for name, (lines, curves) in c.files.items():
        if posture not in (None, name):
            continue
        new = {}
        for channel, curve in curves.items():
            response, reference = ends(channel)
            # The file's channel a holds what was measured along to[a].
            a, b = response[-1], reference[-1]
            source = f"{response[:-1]}{to[a]}/{reference[:-1]}{to[b] if both else b}"
            factor = sign[a] * (sign[b] if both else 1)
            if source in curves:
                new[channel] = [factor * h for h in curves[source]]
        c.files[name] = (lines, new)
    return (f"posture {posture}" if posture else "all"), None


def posture_swap(c, draw):
    a, b = draw.sample(sorted(c.files), 2)
    c.files[a], c.files[b] = c.files[b], c.files[a]
    return f"{a} {b}", None


def channel_gain(c, draw):
    factor = math.exp(either(draw, 0.05, 0.7))
    posture = draw.choice([None, draw.choice(sorted(c.files))])
    axis = draw.choice([None, draw.choice("XY")])
    c.change(posture, lambda ch, f, h: h * factor if axis in (None, ends(ch)[0][-1]) else h)
    return (f"posture {posture}" if posture else "all") + (f", response {axis}" if axis else ""), factor


def channel_sign(c, draw):
    posture = draw.choice([None, draw.choice(sorted(c.files))])
    axis = draw.choice([None, draw.choice("XY")])
    c.change(posture, lambda ch, f, h: -h if axis in (None, ends(ch)[0][-1]) else h)
    return (f"posture {posture}" if posture else "all") + (f", response {axis}" if axis else ""), None


def phase_conjugated(c, draw):
    posture = draw.choice([None, draw.choice(sorted(c.files))])
    c.change(posture, lambda ch, f, h: h.conjugate())
    return f"posture {posture}" if posture else "all", None


def quantity(c, draw):
    posture = draw.choice([None, draw.choice(sorted(c.files))])
    power = draw.choice([-2, -1, 1, 2])
    c.change(posture, lambda ch, f, h: h * (2j * math.pi * f) ** power)
    return f"posture {posture}" if posture else "all", power


def hit_direction(c, draw):
    """Turns the force where all three directions were hit; direct campaigns have no such data."""
    posture = draw.choice([None, draw.choice(sorted(c.files))])
    vector = [draw.gauss(0, 1) for _ in range(3)]
    angle = math.exp(draw.uniform(math.log(2.0), math.log(12.0)))
    length = math.sqrt(sum(v * v for v in vector))
    u = [v / length for v in vector]
    t = math.radians(angle)
    cos, sin = math.cos(t), math.sin(t)
    cross = [[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]]
    turn = [
        [cos * (i == j) + sin * cross[i][j] + (1 - cos) * u[i] * u[j] for j in range(3)] for i in range(3)
    ]
    for name, (lines, curves) in c.files.items():
        if posture not in (None, name):
            continue
        new = {}
        for channel, curve in curves.items():
            response, reference = ends(channel)
            column = "XYZ".index(reference[-1])
            parts = [curves[f"{response}/{reference[:-1]}{axis}"] for axis in "XYZ"]
            new[channel] = [sum(turn[i][column] * parts[i][k] for i in range(3)) for k in range(len(curve))]
        c.files[name] = (lines, new)
    return f"posture {posture}" if posture else "all", angle


def exponential_window(c, draw):
    import numpy

    decay = math.exp(draw.uniform(math.log(0.5), math.log(4.0)))
    for name, (lines, curves) in c.files.items():
        omega = 2 * numpy.pi * numpy.array(lines)
        for channel, curve in curves.items():
            rational = aaa(numpy, omega, numpy.array(curve))
            curves[channel] = [complex(v) for v in rational(omega - 1j * decay)]
    return "all", decay


def aaa(numpy, z, values, tolerance=1e-12, most=40):
    support, error = [], values - values.mean()
    for _ in range(most):
        support.append(int(numpy.argmax(numpy.abs(error))))
        rest = numpy.setdiff1d(numpy.arange(len(z)), support)
        cauchy = 1 / (z[rest, None] - z[None, support])
        loewner = values[rest, None] * cauchy - cauchy * values[None, support]
        weight = numpy.linalg.svd(loewner)[2][-1].conj()
        error = numpy.zeros_like(values)
        error[rest] = values[rest] - (cauchy @ (weight * values[support])) / (cauchy @ weight)
        if numpy.max(numpy.abs(error)) < tolerance * numpy.max(numpy.abs(values)):
            break

    def rational(at):
        cauchy = 1 / (at[:, None] - z[None, support])
        return (cauchy @ (weight * values[support])) / (cauchy @ weight)

    return rational


def sensor_high_pass(c, draw):
    corner = math.exp(draw.uniform(math.log(0.2), math.log(3.0)))
    c.change(None, lambda ch, f, h: h * (1j * f / (1j * f + corner)))
    return "all", corner


def amplifier_low_pass(c, draw):
    corner = math.exp(draw.uniform(math.log(40.0), math.log(200.0)))
    c.change(None, lambda ch, f, h: h / (1 + 1j * f / corner))
    return "all", corner


def late_channel(c, draw):
    """Responses late by some tenths of a millisecond to milliseconds, in the files of one posture."""
    late_ms = either(draw, 0.3, 3.0)
    posture = draw.choice(sorted(c.files))
    c.change(posture, lambda ch, f, h: h * cmath.exp(-2j * math.pi * f * 1e-3 * late_ms))
    return f"posture {posture}", late_ms


def duplicates(c, draw):
    """Another posture's file filed a second time under a posture that has its own."""
    a, b = draw.sample(sorted(c.files), 2)
    lines, curves = c.files[b]
    c.files["again"] = (lines, {ch: list(curve) for ch, curve in curves.items()})
    entry = re.search(rf'\[\[frf\]\]\nfile = "frf/{b}\.csv"\n(?:[^\[]*)', c.toml).group(0)
    c.toml += "\n" + entry.replace(f"frf/{b}.csv", "frf/again.csv").replace(f'"{b}"', f'"{a}"')
    return f"posture {a}", None


KINDS = {
    "encoder-offset": encoder_offset,
    "point-position": point_position,
    "axes": axes,
    "posture-swap": posture_swap,
    "channel-gain": channel_gain,
    "channel-sign": channel_sign,
    "phase-conjugated": phase_conjugated,
    "quantity": quantity,
    "hit-direction": hit_direction,
    "exponential-window": exponential_window,
    "sensor-high-pass": sensor_high_pass,
    "amplifier-low-pass": amplifier_low_pass,
    "late-channel": late_channel,
    "duplicates": duplicates,
    "none": lambda c, draw: ("", None),
}
# Kinds that two direct FRFs a posture cannot show.
NOT_DIRECT = {"hit-direction"}


def try_kinds(description, kinds, fields, one, commands, table):
    """Makes `one(options, kind, seed)` a row of the table for each seed and kind that is asked for and not there yet; returns all rows."""
    arguments = argparse.ArgumentParser(description=description, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--count", type=int, default=20)
    arguments.add_argument("--first-seed", type=int, default=1)
    arguments.add_argument("--kinds", default=",".join(kinds))
    arguments.add_argument("--lobestone", default=str(ROOT / "target/release/lobestone"))
    arguments.add_argument("--command", default=commands[0], choices=commands)
    arguments.add_argument("--table", type=pathlib.Path, default=ROOT / "reports" / table)
    arguments.add_argument("--keep", type=pathlib.Path, help="keep the campaigns in this folder")
    options = arguments.parse_args()
    rows = list(csv.DictReader(options.table.open(newline=""))) if options.table.exists() else []
    done = {(r["kind"], int(r["seed"])) for r in rows}
    for seed in range(options.first_seed, options.first_seed + options.count):
        for kind in options.kinds.split(","):
            if (kind, seed) in done:
                continue
            row = one(options, kind, seed)
            rows.append(row)
            rows.sort(key=lambda r: (list(kinds).index(r["kind"]), int(r["seed"])))
            write_rows(options.table, rows, fields)
            print(" ".join(f"{row[f]}" for f in fields), flush=True)
    return rows


def main():
    rows = try_kinds(__doc__, KINDS, FIELDS, one, ["calibrate", "diagnose", "compare"], "setup_mistakes.csv")
    for kind in KINDS:
        own = [r for r in rows if r["kind"] == kind]
        if own:
            named = sum(r["named"] == "yes" for r in own)
            within = sum(r["within"] == "yes" for r in own if r["within"])
            print(f"{kind}: {named} of {len(own)} right; value within 3 errors or 2 %: {within} of "
                  f"{sum(bool(r['within']) for r in own)}")


def one(options, kind, seed):
    draw = random.Random(f"{kind} {seed}")
    tiers = [t for t in TIERS if not (t == "direct" and kind in NOT_DIRECT)]
    tier = tiers[seed % len(tiers)]
    with tempfile.TemporaryDirectory() as scratch:
        folder = (options.keep or pathlib.Path(scratch)) / f"{kind}-{seed}"
        lobestone(options.lobestone, "simulate", "--out", str(folder), "--kind", tier, "--seed", str(7000 + seed), "--noise", "0",
            "--noise-floor", "0", "--format", "csv")  # fmt: skip
        campaign = Campaign(folder)
        where, value = KINDS[kind](campaign, draw)
        campaign.add_noise(draw, *NOISE[tier])
        campaign.write()
        started = time.monotonic()
        found = lobestone(options.lobestone, options.command, str(folder))
        seconds = time.monotonic() - started
    best = max(found["setup"], key=lambda s: s["confidence"], default=None)
    if best is not None and best["confidence"] < 0.5:
        best = None
    row = dict.fromkeys(FIELDS, "")
    row |= {"seed": seed, "tier": tier, "kind": kind, "where": where, "seconds": f"{seconds:.1f}",
            "verdict": found.get("verdict", "")}  # fmt: skip
    row["value"] = "" if value is None else f"{value:.5g}"
    if best:
        row |= {"said": best["kind"], "said_where": best["where"], "confidence": f"{best['confidence']:.3f}"}
        row["said_value"] = "" if best["value"] is None else f"{best['value']:.5g}"
        row["std_error"] = "" if best["std_error"] is None else f"{best['std_error']:.3g}"
    row["named"] = "yes" if (best["kind"] if best else "none") == kind else "no"
    if value is not None and row["named"] == "yes" and best["value"] is not None:
        off = abs(best["value"] - value)
        row["within"] = "yes" if off <= max(3 * (best["std_error"] or 0), 0.02 * abs(value)) else "no"
    return row


if __name__ == "__main__":
    main()
