#!/usr/bin/env python3
"""The same fit with numpy and scipy, timed against `lobestone` in one run.

    python3 scripts/bench_scipy.py [CAMPAIGN] [--effect base-compliance] [--lobestone PATH] [--repeat N]

Without --effect: the calibration, against `lobestone calibrate`. With it: the fit of one candidate effect together with
the baseline, from nominal values, against `lobestone calibrate --from-nominal` on a copy of the campaign that has the
effect in its model (put there by `lobestone add`, not timed).

An independent check as well: kinematics, mass and stiffness matrices, modal damping, FRFs and the fit are written
here from the formulas (docs/physics.md), sharing no code with the program. Both fit the six joint stiffnesses and
the damping ratio to all FRFs. This script does not estimate the noise: it takes a|H| + b from the campaign's truth
(../truth/NAME.json) where there is one, else it weighs every FRF by its own rms, and the optimum moves a little.

Campaigns: receptance, mobility or accelerance in evenly spaced ASCII UFF 58; points on the tool, axes of the base.
"""

import argparse
import json
import pathlib
import shutil
import subprocess
import tempfile
import time
import tomllib

import numpy as np
from scipy.linalg import eigh
from scipy.optimize import least_squares

HERE = pathlib.Path(__file__).resolve().parent.parent
ROCKING = 1e7  # where the fit of the base's rocking stiffness starts, N·m/rad
ORDER = {8: 0, 11: 1, 12: 2}  # times (i omega)^order against receptance


def transform(q, joint):
    """Standard Denavit-Hartenberg: Rz(q + offset) Tz(d) Tx(a) Rx(alpha)."""
    t = np.radians(q + joint.get("offset_deg", 0.0))
    c, s = np.cos(t), np.sin(t)
    ca, sa = np.cos(np.radians(joint["alpha_deg"])), np.sin(np.radians(joint["alpha_deg"]))
    a, d = joint["a_m"], joint["d_m"]
    return np.array([[c, -s * ca, s * sa, a * c], [s, c * ca, -c * sa, a * s], [0, sa, ca, d], [0, 0, 0, 1]])


class Posture:
    """Mass matrix and tool Jacobian of the chain of joint springs at one posture: constant during the fit."""

    def __init__(self, robot, joints_deg, rocking):
        frames = [np.eye(4)]
        for q, joint in zip(joints_deg, robot["joint"]):
            frames.append(frames[-1] @ transform(q, joint))
        n = len(robot["joint"])
        axes = [f[:3, 2] for f in frames[:n]]
        origins = [f[:3, 3] for f in frames[:n]]
        if rocking:  # the base turns about its x and y axes: two more joints before the first
            axes = [np.array([1.0, 0, 0]), np.array([0, 1.0, 0])] + axes
            origins = [np.zeros(3)] * 2 + origins
        extra = 2 if rocking else 0
        tool = frames[-1] @ np.append(robot["tool"]["tcp_in_flange_m"], 1.0)
        tcp = tool[:3]
        jacobian = lambda p, upto: np.array(
            [np.cross(axes[j], p - origins[j]) if j < upto + extra else np.zeros(3) for j in range(n + extra)]
        ).T
        self.tool_jacobian = jacobian(tcp, n)
        self.mass = np.zeros((n + extra, n + extra))
        for i, link in enumerate(robot["link"]):
            if i + 1 < n:
                com = 0.5 * (frames[i][:3, 3] + frames[i + 1][:3, 3])
            else:
                com = 0.5 * (frames[-1][:3, 3] + tcp)
            jv = jacobian(com, i + 1)
            jw = np.array([axes[j] if j <= i + extra else np.zeros(3) for j in range(n + extra)]).T
            rotation = frames[i + 1][:3, :3]
            inertia = rotation @ np.diag(link["inertia_kg_m2"]) @ rotation.T
            self.mass += link["mass_kg"] * jv.T @ jv + jw.T @ inertia @ jw

    def receptance(self, stiffness, zeta, omega):
        """3 x 3 at the tool point on every line: [line, out, in]."""
        w2, shapes = eigh(np.diag(stiffness), self.mass)
        r = self.tool_jacobian @ shapes
        w = np.sqrt(w2)
        gain = 1.0 / (w2 - omega[:, None] ** 2 + 2j * zeta * w * omega[:, None])
        return np.einsum("ar,fr,br->fab", r, gain, r)


def read_uff(path):
    """(response axis, reference axis, Hz, receptance) of every dataset 58."""
    for block in path.read_text().split("    -1\n")[1::2]:
        lines = block.splitlines()
        dof, axis = lines[6], lines[7]
        count, start, step = int(axis[10:20]), float(axis[30:43]), float(axis[43:56])
        if int(dof[41:51]) != 1 or int(dof[66:76]) != 1:
            raise SystemExit("only tool-point FRFs (node 1) are fitted here")
        numbers = np.array(" ".join(lines[12:]).split(), dtype=float)
        f = start + step * np.arange(count)
        h = (numbers[0::2] + 1j * numbers[1::2])[:count] / (2j * np.pi * f) ** ORDER[int(lines[9][:10])]
        yield int(dof[51:55]) - 1, int(dof[76:80]) - 1, f, h


def noise_std(measured, truth):
    """Standard deviation of every value, m/N; rows are FRFs."""
    if truth.is_file():
        a, b = json.loads(truth.read_text())["noise"]
        return np.hypot(a * np.abs(measured), b)
    return np.sqrt(np.mean(np.abs(measured) ** 2, axis=1, keepdims=True))


def calibrate(folder, effect):
    """Fits the campaign in `folder`; ({name: value}, function evaluations)."""
    truth = folder.parent / "truth" / f"{folder.name}.json"
    campaign = tomllib.loads((folder / "campaign.toml").read_text())
    robot = tomllib.loads((HERE / "datasets/irb6640/robot.toml").read_text())
    postures = {p["id"]: Posture(robot, p["joints_deg"], effect is not None) for p in campaign["posture"]}
    blocks = []
    for entry in campaign["frf"]:
        frfs = list(read_uff(folder / entry["file"]))
        measured = np.array([h for *_, h in frfs])
        std = noise_std(measured, truth)
        blocks.append((postures[entry["posture"]], 2 * np.pi * frfs[0][2], [f[:2] for f in frfs], measured, std))
    names = [f"joint-{i + 1}.stiffness" for i in range(len(robot["joint"]))]
    nominal = np.array([1.0 / j["compliance_rad_per_nm"] for j in robot["joint"]])
    if effect:
        names, nominal = ["base-compliance.rocking_nm_per_rad"] + names, np.append(ROCKING, nominal)

    def springs(theta):
        k = nominal * np.exp(theta[:-1])
        return np.append(k[0], k) if effect else k

    def misfit(theta, log):
        out = []
        for posture, omega, dofs, measured, std in blocks:
            h = posture.receptance(springs(theta), 0.03 * np.exp(theta[-1]), omega)
            model = np.array([h[:, a, b] for a, b in dofs])
            if log:
                out.append(np.log(np.abs(model) / np.abs(measured)).ravel())
            else:
                r = ((model - measured) / std).ravel()
                out += [r.real, r.imag]
        return np.concatenate(out)

    # As in the program: log magnitude first, which leads the peaks onto each other, then complex values.
    near = least_squares(misfit, np.zeros(len(nominal) + 1), args=(True,), x_scale="jac", ftol=1e-4)
    fit = least_squares(misfit, near.x, args=(False,), x_scale="jac", ftol=1e-12, xtol=1e-12)
    values = dict(zip(names, nominal * np.exp(fit.x[:-1])))
    values["damping-ratio"] = 0.03 * np.exp(fit.x[-1])
    evaluations = (near.nfev + near.njev * len(near.x)) + (fit.nfev + fit.njev * len(fit.x))
    return values, evaluations


def timed(work, repeat):
    best, result = np.inf, None
    for _ in range(repeat):
        start = time.perf_counter()
        result = work()
        best = min(best, time.perf_counter() - start)
    return best, result


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("campaign", nargs="?", type=pathlib.Path, default=HERE / "tests/data/blind/frf-9000")
    parser.add_argument("--effect", choices=["base-compliance"], help="fit this candidate instead of the baseline")
    parser.add_argument("--lobestone", type=pathlib.Path, default=HERE / "target/release/lobestone")
    parser.add_argument("--repeat", type=int, default=3, help="runs of each; the fastest counts")
    args = parser.parse_args()

    with tempfile.TemporaryDirectory() as scratch:
        campaign = pathlib.Path(scratch) / "campaign"
        shutil.copytree(args.campaign, campaign)
        run = lambda *words: subprocess.run([args.lobestone, *words, "--json"], check=True, capture_output=True, text=True)
        if args.effect:
            run("add", campaign, args.effect)
        ours_s, ours = timed(
            lambda: json.loads(run("calibrate", campaign, "--from-nominal", "--starts", "0").stdout), args.repeat
        )
    theirs_s, (theirs, evaluations) = timed(lambda: calibrate(args.campaign, args.effect), args.repeat)

    print(f"{'parameter':<20}{'lobestone':>14}{'± std error':>13}{'scipy':>14}{'difference':>12}{'std errors':>12}")
    worst = 0.0
    for p in ours["parameters"]:
        difference = theirs[p["name"]] - p["value"]
        worst = max(worst, abs(difference) / p["value"])
        print(
            f"{p['name']:<20}{p['value']:>14.6g}{p['std_error']:>13.2g}{theirs[p['name']]:>14.6g}"
            f"{difference / p['value']:>+12.2e}{difference / p['std_error']:>+12.2f}"
        )
    print(f"\nlargest difference {100 * worst:.3f} %")
    print(f"lobestone  {ours_s:.3f} s  (whole process: reading, noise estimate, fit, comparison; {ours['iterations']} iterations)")
    print(f"scipy      {theirs_s:.3f} s  (reading and fit; {evaluations} model evaluations, differences for derivatives)")
    print(f"ratio      {theirs_s / ours_s:.1f}")


if __name__ == "__main__":
    main()
