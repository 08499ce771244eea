#!/usr/bin/env python3
"""Tries `lobestone diagnose` on physics that its library does not have, made by a program of its own.

    other_physics.py [--lobestone target/release/lobestone] [--seed 5000] [--kinds gyro,maxwell2,…] [--keep DIR]
                     [--table reports/other_physics.csv]

The robot is that of datasets/irb6640/robot.toml, its joint stiffnesses up to 30 % off; six postures, 36 FRFs each, 2 % noise.
Receptances come from the dynamic stiffness of the rigid links (scripts/link_campaign.py), line by line, with one thing more in
it, faint and strong; none of it uses the program's own model. Writes one row a campaign; a CSV that is there already is
continued. Right is `unknown`, `none` where nothing can be seen, and a library effect that leaves no more than the noise.
Needs numpy and scipy.
"""

import argparse
import csv
import json
import pathlib
import subprocess
import sys
import tempfile
import tomllib

import numpy as np
from scipy.linalg import eigh

import link_campaign

ROOT = pathlib.Path(__file__).resolve().parent.parent
ROBOT = tomllib.loads((ROOT / "datasets/irb6640/robot.toml").read_text())
BODIES = ["tool", "link1", "link2", "link4"]
FREQUENCY_HZ = np.arange(3, 90.01, 0.2)
FIELDS = ["kind", "strength", "size", "verdict", "said", "site", "confidence", "chi2", "chi2_with_best", "right"]

# What is put in, and its sizes, faint and strong.
KINDS = {
    "couple23": ("a rod or a gear couples joints 2 and 3: stiffness between them over the root of theirs", 0.02, 0.2),
    "couple56": ("the wrist's gears couple joints 5 and 6, likewise", 0.02, 0.2),
    "maxwell2": ("a spring in series with a damper (15 Hz) beside joint 2, over its stiffness", 0.03, 0.5),
    "maxwell3": ("the same at joint 3 (25 Hz)", 0.03, 0.5),
    "hose35": ("a hose from link 3 to link 5, kN/mm", 0.02, 0.5),
    "mass3": ("a mass beside link 3 that the file does not have, kg", 1.0, 25.0),
    "gyro": ("a spindle that turns during the hits: its angular momentum, N m s", 1.0, 20.0),
    "nonrec": ("the servo's torque at joint 2 follows joint 3's angle (no reciprocity), as couple23", 0.02, 0.2),
    "springpot": ("joints of a material whose stiffness grows with the frequency to the power 0.3, share of it", 0.02, 0.2),
    "spindlexy": ("a tool that bends 3.3 times as much along x as along y, µm/10 N", 0.03, 1.0),
    "floor": ("a foundation of 2 t on a soft floor that heaves and rocks, softness", 0.05, 1.0),
    "tmd2": ("a mass hung on link 2, 18 Hz one way and 31 Hz the other, kg", 0.5, 12.0),
    "angle": ("joints 2 and 3 stiffer at some of their own angles than at others, relative", 0.02, 0.2),
    "warm23": ("only joints 2 and 3 warm up from posture to posture, relative", 0.01, 0.1),
    "bracket": ("one sensor on a bracket with a resonance of its own, 140 Hz over this", 0.5, 1.0),
    "none": ("nothing", 0.0),
}


class Posture:
    """The rigid robot at one posture: six coordinates of its foot (shifts, turns), then its joints."""

    def __init__(self, joints_deg):
        self.frames, self.tool = link_campaign.frames(ROBOT, joints_deg)
        self.origin, self.tip = [frame[:3, 3] for frame in self.frames], self.tool[:3, 3]
        self.mass = np.zeros((12, 12))
        for i in range(1, 7):
            link = ROBOT["link"][i - 1]
            ends = (self.origin[6], self.tip) if i == 6 else (self.origin[i - 1], self.origin[i])
            j, axes = self.jacobian((ends[0] + ends[1]) / 2, i), self.frames[i][:3, :3]
            self.mass += link["mass_kg"] * j[:3].T @ j[:3]
            self.mass += j[3:].T @ axes @ np.diag(link["inertia_kg_m2"]) @ axes.T @ j[3:]

    def jacobian(self, point, body):
        """6 x 12: velocity and angular velocity of a point on a body."""
        j = np.zeros((6, 12))
        for a, e in enumerate(np.eye(3)):
            j[:3, a], j[:3, 3 + a], j[3:, 3 + a] = e, np.cross(e, point), e
        for i in range(1, body + 1):
            axis = self.frames[i - 1][:3, 2]
            j[:3, 5 + i], j[3:, 5 + i] = np.cross(axis, point - self.origin[i - 1]), axis
        return j

    def points(self):
        """12 x 12: the measured directions."""
        rows = []
        for body in BODIES:
            number = 6 if body == "tool" else int(body[4:])
            rows += list(self.jacobian(self.tip if body == "tool" else self.origin[number], number)[:3])
        return np.array(rows)


def receptances(kind, size, joints_deg, k, ratio, order):
    """Lines x 12 directions x 3 at the tool, m/N. `k`: N m/rad; `ratio`: modal damping; `order`: 0 to 1 over the postures."""
    at = Posture(joints_deg)
    w = 2 * np.pi * FREQUENCY_HZ
    iw, lines = 1j * w, (slice(None), None, None)
    if kind == "angle":
        k = k * (1 + size * np.r_[0, np.cos(2 * np.deg2rad(joints_deg[1:3])), 0, 0, 0])
    if kind == "warm23":
        k = k * (1 - size * order * np.r_[0, 1, 1, 0, 0, 0])
    mass, points = at.mass[6:, 6:], at.points()[:, 6:]
    place = lambda point, body: at.jacobian(point, body)[:, 6:]
    local = lambda body, *shift: at.frames[body][:3, :3] @ np.array(shift)
    if kind == "mass3":
        j = place((at.origin[2] + at.origin[3]) / 2 + local(3, 0.25, 0.2, 0.1), 3)
        mass = mass + size * j[:3].T @ j[:3]
    stiff = np.diag(k)
    for name, a, b in (("couple23", 1, 2), ("couple56", 4, 5)):
        if kind == name:
            stiff[a, b] = stiff[b, a] = size * np.sqrt(k[a] * k[b])
    w2, shapes = eigh(np.diag(k), mass)
    damper = mass @ shapes @ np.diag(2 * ratio * np.sqrt(w2)) @ shapes.T @ mass
    dynamic = stiff + iw[lines] * damper - (w**2)[lines] * mass
    beside = lambda direction, law: law[lines] * np.outer(direction, direction)
    for name, joint, corner_hz in (("maxwell2", 1, 15.0), ("maxwell3", 2, 25.0)):
        if kind == name:
            turn = iw / (2 * np.pi * corner_hz)
            dynamic = dynamic + beside(np.eye(6)[joint], size * k[joint] * turn / (1 + turn))
    if kind == "hose35":
        ends = at.origin[3] + local(3, 0, 0.2, 0.2), at.origin[5] + local(5, 0.1, 0.1, 0)
        along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
        longer = along @ (place(ends[1], 5)[:3] - place(ends[0], 3)[:3])
        dynamic = dynamic + beside(longer, size * 1e6 * (1 + 0.1j) * np.ones_like(w))
    if kind == "gyro":
        h, turn = size * at.tool[:3, 2], place(at.tip, 6)[3:]
        cross = np.array([[0, -h[2], h[1]], [h[2], 0, -h[0]], [-h[1], h[0], 0]])
        dynamic = dynamic + iw[lines] * (turn.T @ cross @ turn)
    if kind == "nonrec":
        dynamic[:, 1, 2] += size * np.sqrt(k[1] * k[2])
    if kind == "springpot":
        dynamic = dynamic + (size * ((iw / (2 * np.pi * 20)) ** 0.3 - 1))[lines] * np.diag(k)
    if kind == "floor":
        block, inertia = np.r_[2e8, 3e8, 4e8, 2e8, 3e8, 4e8] / size, np.r_[2000.0, 2000, 2000, 300, 300, 500]
        whole = np.zeros((len(w), 12, 12), complex)
        whole[:, 6:, 6:] = stiff + iw[lines] * damper
        whole[:, :6, :6] += np.diag(block) + iw[lines] * np.diag(0.04 * np.sqrt(block * inertia))
        dynamic = whole - (w**2)[lines] * (at.mass + np.diag(np.r_[inertia, np.zeros(6)]))
        points = at.points()
    if kind == "tmd2":
        j = place((at.origin[1] + at.origin[2]) / 2 + local(2, 0, 0, 0.3), 2)[:3]
        for axis, hung_hz in ((0, 18.0), (1, 31.0)):
            w0 = 2 * np.pi * hung_hz
            spring = w0**2 + 0.06 * w0 * iw
            dynamic = dynamic + beside(at.frames[2][:3, axis] @ j, -size * w**2 * spring / (spring - w**2))
    hit = np.broadcast_to(points[:3].T, (len(w), points.shape[1], 3))
    h = points @ np.linalg.solve(dynamic, hit)
    if kind == "spindlexy":
        x, y = at.tool[:3, 0], at.tool[:3, 1]
        h[:, :3] += size * 1e-7 * (np.outer(x, x) + 0.3 * np.outer(y, y))
    if kind == "bracket":
        turn = FREQUENCY_HZ * size / 140
        h[:, 7] *= (1 / (1 - turn**2 + 0.04j * turn))[:, None]
    return h


def write(folder, kind, size, seed):
    random = np.random.default_rng(seed)
    k, ratio = link_campaign.drawn(random, ROBOT)
    postures = link_campaign.drawn_postures(random, 6)
    order = lambda number: number / (len(postures) - 1)
    measured = lambda number: receptances(kind, size, postures[number], k, ratio, order(number))
    link_campaign.write(folder, "other physics", BODIES, postures, FREQUENCY_HZ, measured, random)


def diagnosed(program, folder):
    run = subprocess.run([program, "diagnose", str(folder), "--json", "--quiet"], capture_output=True, text=True)
    if run.returncode:
        sys.exit(f"{folder}: {run.stderr}")
    found = json.loads(run.stdout)
    best = min((c["reduced_chi2"] for c in found["candidates"]), default=float("nan"))
    return found, best


def main(about, kinds, write, seed, table_file):
    """Campaigns that `write(folder, kind, size, seed)` makes, kind by kind, diagnosed and judged."""
    arguments = argparse.ArgumentParser(description=about, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--lobestone", default=str(ROOT / "target/release/lobestone"))
    arguments.add_argument("--seed", type=int, default=seed)
    arguments.add_argument("--kinds", default=",".join(kinds))
    arguments.add_argument("--keep", type=pathlib.Path)
    arguments.add_argument("--table", type=pathlib.Path, default=ROOT / table_file)
    asked = arguments.parse_args()
    done = []
    if asked.table.exists():
        with asked.table.open(newline="") as file:
            done = list(csv.DictReader(file))
    known = {(row["kind"], row["strength"]) for row in done}
    with tempfile.TemporaryDirectory() as temporary, asked.table.open("a", newline="") as file:
        table = csv.DictWriter(file, FIELDS)
        if not done:
            table.writeheader()
        for number, (kind, (_, *sizes)) in enumerate(kinds.items()):
            for strength, size in zip(("faint", "strong"), sizes):
                if kind not in asked.kinds.split(",") or (kind, strength) in known:
                    continue
                folder = (asked.keep or pathlib.Path(temporary)) / f"{kind}-{strength}"
                if not folder.exists():
                    write(folder, kind, size, asked.seed + 2 * number + (strength == "strong"))
                found, best = diagnosed(asked.lobestone, folder)
                # A name and `none` are right where they leave no more than the noise; `unknown` where there is something.
                right = {
                    "effect": best < 1.01,
                    "none": found["baseline"]["reduced_chi2"] < 1.01,
                    "unknown": kind != "none",
                }[found["verdict"]]
                row = dict(zip(FIELDS, [kind, strength, size, found["verdict"], found.get("effect"), found.get("site"),
                                        f"{found['confidence']:.2f}", f"{found['baseline']['reduced_chi2']:.3f}",
                                        f"{best:.3f}", right]))  # fmt: skip
                table.writerow(row)
                file.flush()
                print(*row.values())


if __name__ == "__main__":
    main(__doc__, KINDS, write, 5000, "reports/other_physics.csv")
