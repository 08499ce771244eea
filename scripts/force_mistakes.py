#!/usr/bin/env python3
"""Makes one ordinary mistake in the force records of each of many simulated campaigns and looks whether it is named.

    force_mistakes.py [--count 20] [--kinds channel-gain,feed-override,…] [--first-seed 1] [--lobestone target/release/lobestone]
                      [--command diagnose] [--table reports/force_mistakes.csv] [--keep DIR]

`simulate --milling` writes the cuts without noise; one mistake is made in the records or in campaign.toml alone, never with
the model that looks for it, and the noise comes after (before it, where a filter or a speed is what is wrong). Right is the
kind, and the cut or the channel where it is of one. Explicit seeds; a CSV that is there already is continued. Needs numpy.
"""

import math
import pathlib
import random
import re
import tempfile
import time

import numpy

from random_campaigns import lobestone
from setup_mistakes import try_kinds

FIELDS = ["seed", "kind", "where", "value", "said", "said_where", "said_value", "std_error", "confidence", "named",
          "verdict", "verdict_confidence", "seconds"]  # fmt: skip
# Steps between two samples where a record is taken at other times.
FINER = 32
CHANNELS = ["Fx", "Fy", "Fz"]


class Campaign:
    """campaign.toml as text, its cuts as tables, and per cut the record: time, and one column a channel."""

    def __init__(self, folder):
        self.folder = folder
        self.head, *cuts = (folder / "campaign.toml").read_text().split("[[cut]]")
        self.cuts = cuts
        self.records = []
        for cut in cuts:
            lines = (folder / self.text(cut, "file")).read_text().splitlines()
            begin = next(i for i, line in enumerate(lines) if re.match(r"[-\d.]", line))
            self.lines_above = lines[:begin]
            self.records.append(numpy.array([[float(v) for v in line.split()] for line in lines[begin:]]))

    @staticmethod
    def text(cut, key):
        return re.search(rf'^{key} = "(.*)"', cut, re.M).group(1)

    @staticmethod
    def number(table, key):
        return float(re.search(rf"^{key} = (.*)", table, re.M).group(1))

    def stated(self, index, key, function):
        cut = self.cuts[index]
        self.cuts[index] = re.sub(rf"^{key} = (.*)", lambda m: f"{key} = {function(float(m.group(1))):.6g}", cut, flags=re.M)

    def name(self, index):
        return self.text(self.cuts[index], "id")

    def turn_s(self, index):
        return 60.0 / self.number(self.cuts[index], "spindle_rpm")

    def add_noise(self, noise, sigma_n):
        for record in self.records:
            record[:, 1:4] += sigma_n * noise.standard_normal(record[:, 1:4].shape)

    def write(self):
        (self.folder / "campaign.toml").write_text("[[cut]]".join([self.head, *self.cuts]))
        for cut, record in zip(self.cuts, self.records):
            with (self.folder / self.text(cut, "file")).open("w") as file:
                file.write("\n".join(self.lines_above) + "\n")
                numpy.savetxt(file, record, fmt=["%.6f", "%.4f", "%.4f", "%.4f"], delimiter="\t")


def away_from_one(draw, least, most):
    """A factor that is off by so much, up or down."""
    return math.exp(draw.choice([-1, 1]) * draw.uniform(math.log(least), math.log(most)))


def some_cuts(c, draw):
    """From one cut on in the order of cutting, or one alone: not more than half of them."""
    order = sorted(range(len(c.cuts)), key=lambda i: c.number(c.cuts[i], "order"))
    count = draw.choice([1, 2, 3, len(order) // 2])
    return order[-count:]


def channel_gain(c, draw):
    factor = draw.choice([0.5, 2.0, 0.1, 1e-3, away_from_one(draw, 1.05, 2.0)])
    which = draw.randrange(4)
    if which == 3:  # Fy in all cuts: Fx or Fz in all is another set of coefficients.
        factor = away_from_one(draw, 1.05, 2.0)
        cuts, channels, where = range(len(c.cuts)), [1], "Fy of all"
    else:
        cuts = some_cuts(c, draw)
        channels = [[0, 1, 2], [0], [1]][which]
        where = " ".join(CHANNELS[k] for k in channels) + " of " + " ".join(c.name(i) for i in cuts)
    for i in cuts:
        for k in channels:
            c.records[i][:, 1 + k] *= factor
    return where, factor


def filtered(record, rate, corner_hz, order):
    spectrum = numpy.fft.rfft(record[:, 1:4], axis=0)
    s = 1j * numpy.fft.rfftfreq(len(record), 1 / rate) / corner_hz
    divisor = 1 + s if order == 1 else 1 + math.sqrt(2) * s + s * s
    record[:, 1:4] = numpy.fft.irfft(spectrum / divisor[:, None], len(record), axis=0)


def low_pass(c, draw):
    fastest = max(c.number(c.head, "teeth") / c.turn_s(i) for i in range(len(c.cuts)))
    corner = fastest * math.exp(draw.uniform(math.log(0.5), math.log(5.0)))
    order = draw.choice([1, 2])
    for record in c.records:
        filtered(record, 1 / (record[1, 0] - record[0, 0]), corner, order)
    return f"order {order}, all", corner


def swinging(c, draw, angle_of):
    """Every record as the tool stood: at the angle of its mean turning plus `angle_of`."""
    for i, record in enumerate(c.records):
        t = record[:, 0]
        ahead_s = angle_of(t, c.turn_s(i)) * c.turn_s(i) / math.tau
        # Between samples as the band that was sampled has it: straight lines there are a low-pass.
        fine = FINER * len(t)
        spectrum = numpy.fft.rfft(record[:, 1:4], axis=0)
        values = FINER * numpy.fft.irfft(spectrum, fine, axis=0)
        fine_t = t[0] + (t[1] - t[0]) / FINER * numpy.arange(fine)
        for k in range(3):
            record[:, 1 + k] = numpy.interp(t + ahead_s, fine_t, values[:, k])


def wandering_speed(c, draw):
    """The speed goes up and down by so much, rms, over a second or so."""
    share = draw.uniform(0.005, 0.03)
    tones = [(draw.uniform(0.5, 3.0), draw.uniform(0, math.tau)) for _ in range(3)]

    def angle(t, turn_s):
        swings = [math.sqrt(2 / 3) / (math.tau * f) * numpy.sin(math.tau * f * t + phase) for f, phase in tones]
        return math.tau / turn_s * share * sum(swings)

    swinging(c, draw, angle)
    return "all", share


def drooping_speed(c, draw):
    """Under load the speed falls by so much from beginning to end."""
    share = draw.uniform(0.01, 0.04)
    swinging(c, draw, lambda t, turn_s: -math.tau / turn_s * share * (t - t.mean()) ** 2 / (2 * (t[-1] - t[0])))
    return "all", share


def stated_wrongly(key, least, most):
    """One number of one cut is off by a factor."""

    def make(c, draw):
        index = draw.randrange(len(c.cuts))
        factor = away_from_one(draw, least, most)
        c.stated(index, key, lambda value: value / factor)
        return c.name(index), factor

    return make


def cut_swap(c, draw):
    a, b = draw.sample(range(len(c.cuts)), 2)
    while c.cuts[a].split("process")[1].split("order")[0] == c.cuts[b].split("process")[1].split("order")[0]:
        a, b = draw.sample(range(len(c.cuts)), 2)
    c.records[a], c.records[b] = c.records[b], c.records[a]
    return f"{c.name(a)} {c.name(b)}", None


def teeth(c, draw):
    c.head = re.sub(r"^teeth = (\d+)", lambda m: f"teeth = {2 * int(m.group(1))}", c.head, flags=re.M)
    return "tool", None


def helix(c, draw):
    factor = away_from_one(draw, 1.2, 1.6)
    c.head = re.sub(r"^helix_deg = (.*)", lambda m: f"helix_deg = {float(m.group(1)) / factor:.4g}", c.head, flags=re.M)
    return "tool", None


def axes(c, draw):
    """Turned by 90° about the tool's axis, either way, or the two cables exchanged."""
    signs = draw.choice([(-1, 1), (1, -1), (1, 1)])
    for record in c.records:
        record[:, 1:3] = record[:, [2, 1]] * signs
    return "all", None


def channel_sign(c, draw):
    cuts = some_cuts(c, draw)
    channel = draw.choice([0, 1])
    for i in cuts:
        c.records[i][:, 1 + channel] *= -1
    return f"{CHANNELS[channel]} of " + " ".join(c.name(i) for i in cuts), None


def dead_channel(c, draw):
    index, channel = draw.randrange(len(c.cuts)), draw.randrange(3)
    c.records[index][:, 1 + channel] = 0.0
    return f"{CHANNELS[channel]} of {c.name(index)}", None


# What is said of each, what makes it, and whether noise comes before.
KINDS = {
    "channel-gain": ("channel-gain", channel_gain, True),
    "amplifier-low-pass": ("amplifier-low-pass", low_pass, True),
    "wandering-speed": ("spindle-speed-variation", wandering_speed, False),
    "drooping-speed": ("spindle-speed-variation", drooping_speed, False),
    "feed-override": ("feed-override", stated_wrongly("feed_per_tooth_mm", 1.1, 2.0), False),
    "axial-depth": ("axial-depth", stated_wrongly("axial_depth_mm", 1.15, 2.0), False),
    "spindle-speed": ("spindle-speed", stated_wrongly("spindle_rpm", 1.03, 1.6), False),
    "cut-swap": ("cut-swap", cut_swap, False),
    "teeth": ("teeth", teeth, False),
    "helix": ("helix", helix, False),
    "axes": ("axes", axes, False),
    "channel-sign": ("channel-sign", channel_sign, False),
    "dead-channel": ("dead-channel", dead_channel, False),
}


def main():
    rows = try_kinds(__doc__, KINDS, FIELDS, one, ["diagnose", "cfc"], "force_mistakes.csv")
    for kind in KINDS:
        own = [r for r in rows if r["kind"] == kind]
        if own:
            print(f"{kind}: {sum(r['named'] == 'yes' for r in own)} of {len(own)} named")


def one(options, kind, seed):
    draw = random.Random(f"{kind} {seed}")
    noise = numpy.random.default_rng([seed, sum(map(ord, kind))])
    expected, make, noise_first = KINDS[kind]
    with tempfile.TemporaryDirectory() as scratch:
        folder = (options.keep or pathlib.Path(scratch)) / f"{kind}-{seed}"
        lobestone(options.lobestone, "simulate", "--milling", "--out", str(folder), "--seed", str(40_000 + seed), "--noise-n", "0")
        campaign = Campaign(folder)
        sigma_n = math.exp(draw.uniform(math.log(1.0), math.log(10.0)))
        if noise_first:
            campaign.add_noise(noise, sigma_n)
        where, value = make(campaign, draw)
        if not noise_first:
            campaign.add_noise(noise, sigma_n)
        campaign.write()
        started = time.monotonic()
        found = lobestone(options.lobestone, options.command, str(folder))
        seconds = time.monotonic() - started
    mine = [s for s in found["setup"] if s["kind"] == expected and s["confidence"] >= 0.5]
    best = max(mine or found["setup"], key=lambda s: s["confidence"], default=None)
    row = dict.fromkeys(FIELDS, "")
    row |= {"seed": seed, "kind": kind, "where": where, "seconds": f"{seconds:.1f}",
            "verdict": found.get("effect") or found.get("verdict", ""),
            "verdict_confidence": found.get("confidence", "")}  # fmt: skip
    row["value"] = "" if value is None else f"{value:.5g}"
    if best:
        row |= {"said": best["kind"], "said_where": best["where"], "confidence": f"{best['confidence']:.3f}"}
        row["said_value"] = "" if best["value"] is None else f"{best['value']:.5g}"
        row["std_error"] = "" if best["std_error"] is None else f"{best['std_error']:.3g}"
    cuts = [name for name in re.findall(r"c\d\d", where)]
    row["named"] = "yes" if mine and all(name in best["where"] for name in cuts) else "no"
    return row


if __name__ == "__main__":
    main()
