#!/usr/bin/env python3
"""Campaigns of a robot whose links are not those of its file, by a program of its own: the truth for `calibrate --free`.

python3 scripts/link_campaign.py FOLDER [inertia|d4|wall|both|none] [--seed N] [--thin]

The robot is the one of datasets/irb6640/robot.toml with, by kind, link 4 turned harder (Ix, Iy 31 -> 60 kg m2), joint 4 longer
(d + 20 mm), link 2's wall 30 % thinner (links of 120 GPa that bend), inertia and length together, or nothing changed; its joint
stiffnesses lie within +-30 % of the file's in any case. Prints the truth. --thin is what tests/data/links/both was made with.
Needs numpy and scipy.
"""
import argparse
import copy
import pathlib
import tomllib

import numpy as np
from scipy.linalg import eigh

TAP_POSTURES = [[135, -2, 53, 83, 30, -117], [135, 20, 26, 30, 80, -150]]


def turn(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    t = np.eye(4)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    t[i, i] = t[j, j] = c
    t[i, j], t[j, i] = -s, s
    return t


def shift(x, y, z):
    t = np.eye(4)
    t[:3, 3] = [x, y, z]
    return t


def frames(robot, joints_deg):
    all_frames = [np.eye(4)]
    for joint, q in zip(robot["joint"], joints_deg):
        along = turn("z", np.deg2rad(q + joint["offset_deg"])) @ shift(0, 0, joint["d_m"])
        across = shift(joint["a_m"], 0, 0) @ turn("x", np.deg2rad(joint["alpha_deg"]))
        all_frames.append(all_frames[-1] @ along @ across)
    tool = robot["tool"]
    tilt = turn("y", np.deg2rad(tool["tilt_about_flange_y_deg"]))
    return all_frames, all_frames[-1] @ shift(*tool["tcp_in_flange_m"]) @ tilt


def cantilever(length, link, young):
    """Stiffness of a round hollow beam's free end, own axes, from its compliance."""
    outer = link["section_outer_diameter_m"]
    inner = outer - 2 * link["section_wall_m"]
    area, second = np.pi / 4 * (outer**2 - inner**2), np.pi / 64 * (outer**4 - inner**4)
    c = np.zeros((6, 6))
    c[0, 0] = length / (young * area)
    c[1, 1] = c[2, 2] = length**3 / (3 * young * second)
    c[3, 3] = length / (young / 2.6 * 2 * second)
    c[4, 4] = c[5, 5] = length / (young * second)
    c[1, 5] = c[5, 1] = length**2 / (2 * young * second)
    c[2, 4] = c[4, 2] = -(length**2) / (2 * young * second)
    return np.linalg.inv(c)


def receptances(robot, joints_deg, stiffness, damping, f, bodies, young):
    """Lines x (three directions a body) x three directions at the tool, m/N: modal damping, relative coordinates."""
    t, tool = frames(robot, joints_deg)
    origin, tip = [frame[:3, 3] for frame in t], tool[:3, 3]
    elements = []
    for i in range(1, 7):
        link, end = robot["link"][i - 1], tip if i == 6 else origin[i]
        elements.append(((i, 0), origin[i - 1], [np.r_[0, 0, 0, t[i - 1][:3, 2]]], [[stiffness[i - 1]]]))
        span = np.linalg.norm(end - origin[i - 1])
        if young and "section_wall_m" in link and span > 1e-9:
            x = (end - origin[i - 1]) / span
            seed = np.array([0.0, 0, 1]) if abs(x[2]) < 0.9 else np.array([1.0, 0, 0])
            y = np.cross(seed, x) / np.linalg.norm(np.cross(seed, x))
            axes = [x, y, np.cross(x, y)]
            twists = [np.r_[a, 0, 0, 0] for a in axes] + [np.r_[0, 0, 0, a] for a in axes]
            k = cantilever(span / 2, link, young)
            elements.append(((i, 1), (origin[i - 1] + end) / 2, twists, k))
            elements.append(((i, 3), end, twists, k))
    count = sum(len(e[2]) for e in elements)
    k = np.zeros((count, count))
    at = 0
    for _, _, twists, block in elements:
        k[at : at + len(twists), at : at + len(twists)] = block
        at += len(twists)

    def jacobian(point, place):
        j, column = np.zeros((6, count)), 0
        for where, pivot, twists, _ in elements:
            for twist in twists:
                if where <= place:
                    j[:3, column] = twist[:3] + np.cross(twist[3:], point - pivot)
                    j[3:, column] = twist[3:]
                column += 1
        return j

    m = np.zeros((count, count))
    for i in range(1, 7):
        link = robot["link"][i - 1]
        ends = (origin[6], tip) if i == 6 else (origin[i - 1], origin[i])
        j, axes = jacobian((ends[0] + ends[1]) / 2, (i, 2)), t[i][:3, :3]
        m += link["mass_kg"] * j[:3].T @ j[:3] + j[3:].T @ axes @ np.diag(link["inertia_kg_m2"]) @ axes.T @ j[3:]
    mu, shapes = eigh(m, k)
    mu = np.clip(mu, 0, None)
    rows = []
    for body in bodies:
        at_tool = body == "tool"
        number = 6 if at_tool else int(body[4:])
        rows += list(jacobian(tip if at_tool else origin[number], (number, 4))[:3])
    phi, w = np.array(rows) @ shapes, 2 * np.pi * f[:, None]
    modal = 1 / (1 - w**2 * mu + 2j * damping * w * np.sqrt(mu))
    return np.einsum("oi,fi,ji->foj", phi, modal, phi[:3])


def write(folder, name, bodies, postures, f, measured, random):
    """A campaign of the IRB 6640. `measured(number)`: receptances of a posture, as `receptances` has them; noise is put on them."""
    (folder / "frf").mkdir(parents=True, exist_ok=True)
    text = f'schema = "lobestone/campaign/1"\nname = "{name}"\n\n[robot]\nmodel = "irb6640"\n'
    for node, body in enumerate(bodies, 1):
        text += f'\n[[point]]\nnode = {node}\nbody = "{body}"\nposition_m = [0.0, 0.0, 0.0]\naxes = "base"\n'
    names = [f"{node}{axis}/1{hit}" for node in range(1, len(bodies) + 1) for axis in "XYZ" for hit in "XYZ"]
    header = "frequency_hz," + ",".join(f"re({n}),im({n})" for n in names)
    formats = ["%.2f"] + ["%.4e"] * (2 * len(names))
    for number, posture in enumerate(postures):
        h = measured(number)
        std = np.hypot(0.02 * abs(h), 2e-8)
        h = h + std * (random.normal(size=h.shape) + 1j * random.normal(size=h.shape)) / np.sqrt(2)
        columns = [f]
        for value in h.reshape(len(f), -1).T:
            columns += [value.real, value.imag]
        file = f"frf/p{number + 1}.csv"
        np.savetxt(folder / file, np.array(columns).T, delimiter=",", header=header, comments="", fmt=formats)
        angles = [float(q) for q in posture]
        text += f'\n[[posture]]\nid = "p{number + 1}"\njoints_deg = {angles}\n'
        text += f'\n[[frf]]\nfile = "{file}"\nposture = "p{number + 1}"\nquantity = "receptance"\n'
    (folder / "campaign.toml").write_text(text)


def drawn(random, robot):
    """Joint stiffnesses within 30 % of the file's, N m/rad, and a damping ratio."""
    stiffness = np.array([1 / j["compliance_rad_per_nm"] for j in robot["joint"]])
    return stiffness * np.exp(random.uniform(-0.3, 0.3, 6)), random.uniform(0.02, 0.04)


def drawn_postures(random, count):
    """The tap postures, and others around them, deg."""
    around = lambda i: np.round(np.array(TAP_POSTURES[i % 2]) + random.uniform(-25, 25, 6), 1)
    return TAP_POSTURES + [list(around(i)) for i in range(count - 2)]


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("folder", type=pathlib.Path)
    arguments.add_argument("kind", choices=["inertia", "d4", "wall", "both", "none"])
    arguments.add_argument("--seed", type=int, default=1)
    arguments.add_argument("--thin", action="store_true")
    asked = arguments.parse_args()
    here = pathlib.Path(__file__).parent.parent
    robot = copy.deepcopy(tomllib.loads((here / "datasets/irb6640/robot.toml").read_text()))
    if asked.kind in ("inertia", "both"):
        robot["link"][3]["inertia_kg_m2"] = [60.0, 60.0, robot["link"][3]["inertia_kg_m2"][2]]
    if asked.kind in ("d4", "both"):
        robot["joint"][3]["d_m"] += 0.02
    if asked.kind == "wall":
        robot["link"][1]["section_wall_m"] *= 0.7
    young = 120e9 if asked.kind == "wall" else None
    random = np.random.default_rng(asked.seed)
    stiffness, damping = drawn(random, robot)
    count, step = (4, 0.6) if asked.thin else (6, 0.2)
    bodies = ["tool", "link2", "link4"] if asked.thin else ["tool", "link1", "link2", "link4"]
    postures = drawn_postures(random, count)
    f = np.arange(3, 90.01, step)
    measured = lambda number: receptances(robot, postures[number], stiffness, damping, f, bodies, young)
    write(asked.folder, "links", bodies, postures, f, measured, random)
    print("joint stiffness, N m/rad:", ", ".join(f"{k:.4g}" for k in stiffness), f"damping ratio {damping:.4f}")


if __name__ == "__main__":
    main()
