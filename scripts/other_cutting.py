#!/usr/bin/env python3
"""Tries `lobestone diagnose` on force records with physics that its library does not have, made by a program of its own.

    other_cutting.py [--lobestone target/release/lobestone] [--seed 6000] [--kinds heat,impact,…] [--keep DIR]
                     [--table reports/other_cutting.csv]

An end mill of 12 mm, four teeth, helix 30°; sixteen cuts (four feeds × four speeds, slots and half immersion, two depths) with
air before and after, 8 kHz, white noise and hum. Forces are added up slice by slice along the edges (Altintas 2012, eq. 2.44 to
2.56), with one thing more in them, faint and strong; none of it uses the program's own model. Writes one row a campaign and
judges it as scripts/other_physics.py does. Needs numpy.
"""

import pathlib

import numpy as np

import other_physics

DIAMETER_MM, TEETH, HELIX = 12.0, 4, np.deg2rad(30.0)
RATE_HZ, AIR_S, CUT_S, SLICE_MM = 8000, 0.6, 1.2, 0.05
# N/mm² and N/mm: tangential, radial, axial.
CUTTING, EDGE = np.array([900.0, 360.0, 180.0]), np.array([16.0, 20.0, 2.0])
FEEDS_MM, SPEEDS_RPM = (0.04, 0.07, 0.11, 0.16), (1300, 1900, 2600, 3400)
NOISE_N, HUM_N = 6.0, 2.0

# What is put in, and its sizes, faint and strong.
KINDS = {
    "heat": ("the chip softens within each cut, by this share at its end", 0.03, 0.3),
    "tooth": ("one tooth has another rake: its cutting coefficients by this share higher", 0.03, 0.3),
    "helix": ("the helix is not the stated one, degrees more", 1.0, 10.0),
    "two-helices": ("every other tooth has another helix, degrees more", 1.0, 10.0),
    "depth": ("the top of the work lies higher than thought, mm", 0.02, 0.3),
    "override": ("the feed of the fastest cuts was overridden, by this share", 0.03, 0.25),
    "clipped": ("the amplifier gives less where the force is large: relative at the largest force, cubic", 0.02, 0.2),
    "one-sided": ("the plate is by this share stiffer against pull than against push", 0.02, 0.2),
    "flow": ("the coolant's jet presses on the work while it runs (in cuts only), N along z", 1.0, 15.0),
    "impact": ("each tooth rings at 900 Hz as it enters, N", 3.0, 40.0),
    "exit": ("the edge ploughs more towards its exit: edge force by this factor higher there, quadratic in the angle", 0.05, 1.0),
    "skew": ("one channel is sampled later than the others, ms", 0.01, 0.15),
    "bend": ("the tool bends away from the wall: immersion less by µm/N of the normal force", 0.05, 1.5),
    "bands": ("the material is harder in bands of 6 mm, by this share", 0.02, 0.2),
    "axial-speed": ("the axial coefficient alone falls with speed, exponent", 0.05, 0.6),
    "rubbing": ("the flank rubs in proportion to speed, N/mm per m/s", 0.3, 4.0),
    "memory": ("the amplifier's time constant is short, s", 8.0, 0.15),
    "threshold": ("chips under this thickness do not form, mm", 0.002, 0.02),
    "none": ("nothing", 0.0),
}


def forces(kind, size, cut, random):
    """Samples x 3 on the tool (x feed, y normal, z axial), N, of the time in the cut."""
    time = np.arange(round(CUT_S * RATE_HZ)) / RATE_HZ
    turn = 2 * np.pi * cut["rpm"] / 60 * time + random.uniform(0, 2 * np.pi)
    feed = cut["feed"] * (1 + size if kind == "override" and cut["rpm"] == max(SPEEDS_RPM) else 1)
    depth = cut["depth"] + (size if kind == "depth" else 0)
    speed_m_s = np.pi * DIAMETER_MM * 1e-3 * cut["rpm"] / 60
    start, end = np.deg2rad(cut["angles"])
    share = np.ones_like(time)
    if kind == "heat":
        share = 1 - size * (1 - np.exp(-time / 0.4)) / (1 - np.exp(-CUT_S / 0.4))
    if kind == "bands":
        travel_mm = feed * TEETH * cut["rpm"] / 60 * time
        share = 1 + size * np.sin(2 * np.pi * travel_mm / 6.0)
    total = np.zeros((len(time), 3))
    heights = (np.arange(round(depth / SLICE_MM)) + 0.5) * depth / round(depth / SLICE_MM)
    thick = depth / len(heights)
    for _ in range(2 if kind == "bend" else 1):
        # Bent by the mean normal force of the pass before: the wall is reached later.
        away_mm = size * 1e-3 * abs(total[:, 1].mean()) if kind == "bend" else 0.0
        late = away_mm / (DIAMETER_MM / 2 * max(np.sin(start), 0.2)) if start > 0 else 0.0
        early = away_mm / (DIAMETER_MM / 2 * max(np.sin(end), 0.2)) if end < np.pi else 0.0
        total = np.zeros((len(time), 3))
        for tooth in range(TEETH):
            cutting, edge = CUTTING.copy(), EDGE.copy()
            helix = HELIX
            if kind == "tooth" and tooth == 1:
                cutting = cutting * (1 + size)
            if kind == "helix" or (kind == "two-helices" and tooth % 2):
                helix = HELIX + np.deg2rad(size)
            if kind == "axial-speed":
                cutting[2] *= (speed_m_s / 1.4) ** -size
            if kind == "rubbing":
                edge[:2] += size * (speed_m_s - 1.4)
            for z in heights:
                angle = (turn + 2 * np.pi * tooth / TEETH - 2 * z * np.tan(helix) / DIAMETER_MM) % (2 * np.pi)
                inside = (angle > start + late) & (angle < end - early)
                chip = feed * np.sin(angle)
                ploughed = 1.0
                if kind == "exit":
                    ploughed = 1 + size * ((angle - start) / (end - start)) ** 2
                if kind == "threshold":
                    chip = np.where(chip > size, chip, 0.4 * chip)
                t, r, a = ((share * cutting[i] * chip + edge[i] * ploughed) * inside * thick for i in range(3))
                total[:, 0] += -t * np.cos(angle) - r * np.sin(angle)
                total[:, 1] += t * np.sin(angle) - r * np.cos(angle)
                total[:, 2] += a
    if kind == "impact":
        since = ((turn - start) % (2 * np.pi / TEETH)) / (2 * np.pi * cut["rpm"] / 60)
        total[:, 1] += size * np.exp(-2 * np.pi * 900 * 0.03 * since) * np.sin(2 * np.pi * 900 * since)
    if kind == "flow":
        total[:, 2] += size
    return total


def recorded(kind, size, total, largest):
    """What the dynamometer makes of the forces of a whole record."""
    if kind == "clipped":
        total = total * (1 - size * (total / largest) ** 2)
    if kind == "one-sided":
        total = np.where(total > 0, total, total * (1 - size))
    if kind == "skew":
        time = np.arange(len(total)) / RATE_HZ
        total = np.column_stack([total[:, 0], np.interp(time - size * 1e-3, time, total[:, 1]), total[:, 2]])
    if kind == "memory":
        level, out = np.zeros(3), np.empty_like(total)
        for i, f in enumerate(total):
            level = level + (f - level) / (RATE_HZ * size)
            out[i] = f - level
        total = out
    return total


def write(folder, kind, size, seed):
    random = np.random.default_rng(seed)
    (folder / "force").mkdir(parents=True)
    cuts = []
    for i, feed in enumerate(FEEDS_MM):
        for j, rpm in enumerate(SPEEDS_RPM):
            angles = [(0, 180), (90, 180), (0, 180), (0, 90)][(i + j) % 4]
            cuts.append({"feed": feed, "rpm": rpm, "depth": (1.5, 3.0)[(i + j // 2) % 2], "angles": angles})
    pure = [forces(kind, size, cut, random) for cut in cuts]
    largest = max(np.abs(f).max() for f in pure)
    lines = ['schema = "lobestone/campaign/1"', 'name = "other cutting"', "", "[tool]", 'kind = "endmill"']
    lines += [f"diameter_mm = {DIAMETER_MM}", f"teeth = {TEETH}", f"helix_deg = {np.rad2deg(HELIX):.1f}"]
    lines += ["", "[material]", 'name = "steel"']
    order = random.permutation(len(cuts)) + 1
    air = np.zeros((round(AIR_S * RATE_HZ), 3))
    for number, (cut, f) in enumerate(zip(cuts, pure)):
        total = recorded(kind, size, np.vstack([air, f, air]), largest)
        time = np.arange(len(total)) / RATE_HZ
        total = total + NOISE_N * random.standard_normal(total.shape)
        total += HUM_N * np.sin(2 * np.pi * 50 * time + random.uniform(0, 6.28))[:, None] + random.uniform(-20, 20, 3)
        name = f"force/cut{number + 1:02d}.csv"
        np.savetxt(folder / name, np.column_stack([time, total]), ["%.6f", *["%.2f"] * 3], ",", header="time_s,fx_n,fy_n,fz_n", comments="")
        lines += ["", "[[cut]]", f'id = "{number + 1:02d}"', f'file = "{name}"', 'process = "milling"']
        lines += [f"spindle_rpm = {cut['rpm']}.0", f"feed_per_tooth_mm = {cut['feed']}", f"axial_depth_mm = {cut['depth']}"]
        lines += [f"start_deg = {cut['angles'][0]}.0", f"exit_deg = {cut['angles'][1]}.0", f"order = {order[number]}"]
    (folder / "campaign.toml").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    other_physics.main(__doc__, KINDS, write, 6000, "reports/other_cutting.csv")
