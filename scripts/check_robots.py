#!/usr/bin/env python3
"""Checks what lobestone makes of robots against pinocchio.

    python3 -m venv venv && venv/bin/pip install pin
    venv/bin/python scripts/check_robots.py --lobestone target/release/lobestone [--postures 1000] [--table]

For each robot: tool point and axis, mass and centre of mass of the moving links, gravity torques, and natural frequencies
of the joints' springs on pinocchio's mass matrix, at random postures. Robots: the URDFs of tests/data/urdf as `lobestone
init` reads them; the robot files of datasets/robots against URDFs written here from the same published figures; and all of
them once more as `lobestone model --urdf` writes them. Fails (status 1) where anything differs by more than 1e-9 of its
size. `--table` prints reference numbers for tests/integration/robots.rs.
"""
import argparse
import json
import pathlib
import random
import subprocess
import sys
import tempfile
import tomllib

import numpy as np
import pinocchio as pin

ROOT = pathlib.Path(__file__).resolve().parent.parent
TOLERANCE = 1e-9

# The UR10e in the convention of URDF: joint origins (xyz, rpy), masses, centres of mass and tensors in link frames.
H = np.pi / 2
UR10E_ORIGINS = [
    ((0, 0, 0.1807), (0, 0, 0)),
    ((0, 0, 0), (H, 0, 0)),
    ((-0.6127, 0, 0), (0, 0, 0)),
    ((-0.57155, 0, 0.17415), (0, 0, 0)),
    ((0, -0.11985, 0), (H, 0, 0)),
    ((0, 0.11655, 0), (H, np.pi, np.pi)),
]
# mass; centre; roll of the tensor's axes; ixx ixy ixz iyy iyz izz
UR10E_LINKS = [
    (7.369, (0.021, -0.027, 0.0), H, (0.03408, 0.00002, -0.00425, 0.03529, 0.00008, 0.02156)),
    (13.051, (-0.2327, 0.0, 0.158), 0, (0.02814, 0.00005, -0.01561, 0.77068, 0.00002, 0.76943)),
    (3.989, (-0.33155, 0.0, 0.068), 0, (0.01014, 0.00008, 0.00916, 0.30928, 0.0, 0.30646)),
    (2.1, (0.0, -0.018, 0.007), H, (0.00296, -0.00001, 0.0, 0.00222, -0.00024, 0.00258)),
    (1.98, (0.0, 0.018, -0.007), -H, (0.00296, -0.00001, 0.0, 0.00222, -0.00024, 0.00258)),
    (0.615, (0.0, 0.0, -0.026), 0, (0.0004, 0, 0, 0.00041, 0, 0.00034)),
]
IIWA_ORIGINS = [
    ((0, 0, 0.1575), (0, 0, 0)),
    ((0, 0, 0.2025), (H, 0, np.pi)),
    ((0, 0.2045, 0), (H, 0, np.pi)),
    ((0, 0, 0.2155), (H, 0, 0)),
    ((0, 0.1845, 0), (-H, np.pi, 0)),
    ((0, 0, 0.2155), (H, 0, 0)),
    ((0, 0.081, 0), (-H, np.pi, 0)),
]
IIWA_LINKS = [
    (4, (0, -0.03, 0.12), 0, (0.1, 0, 0, 0.09, 0, 0.02)),
    (4, (0.0003, 0.059, 0.042), 0, (0.05, 0, 0, 0.018, 0, 0.044)),
    (3, (0, 0.03, 0.13), 0, (0.08, 0, 0, 0.075, 0, 0.01)),
    (2.7, (0, 0.067, 0.034), 0, (0.03, 0, 0, 0.01, 0, 0.029)),
    (1.7, (0.0001, 0.021, 0.076), 0, (0.02, 0, 0, 0.018, 0, 0.005)),
    (1.8, (0, 0.0006, 0.0004), 0, (0.005, 0, 0, 0.0036, 0, 0.0047)),
    (0.3, (0, 0, 0.02), 0, (0.001, 0, 0, 0.001, 0, 0.001)),
]


def urdf_of(name, origins, links, tool_z):
    text = f'<robot name="{name}"><link name="base_link"/>'
    parent = "base_link"
    words = lambda values: " ".join(repr(float(v)) for v in values)
    for i, ((xyz, rpy), (mass, com, roll, tensor)) in enumerate(zip(origins, links), 1):
        text += (
            f'<joint name="j{i}" type="revolute"><origin xyz="{words(xyz)}" rpy="{words(rpy)}"/><parent link="{parent}"/>'
            f'<child link="l{i}"/><axis xyz="0 0 1"/><limit lower="-6.28" upper="6.28" effort="1" velocity="1"/></joint>'
            f'<link name="l{i}"><inertial><origin xyz="{words(com)}" rpy="{roll!r} 0 0"/><mass value="{mass}"/>'
            + "<inertia "
            + " ".join(f'{k}="{v!r}"' for k, v in zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), tensor))
            + "/></inertial></link>"
        )
        parent = f"l{i}"
    return (
        text
        + f'<joint name="jt" type="fixed"><origin xyz="0 0 {tool_z}"/><parent link="{parent}"/><child link="tool0"/></joint>'
        + '<link name="tool0"/></robot>'
    )


class Pinocchio:
    """A chain of joints of a URDF; joints that are not in `joints` are held at zero."""

    def __init__(self, text, joints, base, tool):
        model = pin.buildModelFromXML(text)
        held = [model.getJointId(n) for n in model.names[1:] if n not in joints]
        self.model = pin.buildReducedModel(model, held, pin.neutral(model)) if held else model
        self.data = self.model.createData()
        self.joints, self.tool = joints, self.model.getFrameId(tool)
        pin.framesForwardKinematics(self.model, self.data, pin.neutral(self.model))
        # Frames and gravity as the base has them; a fixed base stands anywhere in the world of the file.
        self.base = self.data.oMf[self.model.getFrameId(base)].copy()
        self.model.gravity.linear = self.base.rotation @ np.array([0, 0, -9.80665])

    def at(self, q, compliance):
        configuration = pin.neutral(self.model)
        order = []
        for name, angle in zip(self.joints, q):
            joint = self.model.joints[self.model.getJointId(name)]
            if joint.nq == 2:
                configuration[joint.idx_q : joint.idx_q + 2] = np.cos(angle), np.sin(angle)
            else:
                configuration[joint.idx_q] = angle
            order.append(joint.idx_v)
        pin.framesForwardKinematics(self.model, self.data, configuration)
        tool = self.base.actInv(self.data.oMf[self.tool])
        torque = pin.computeGeneralizedGravity(self.model, self.data, configuration)[order]
        centre = self.base.actInv(pin.centerOfMass(self.model, self.data, configuration))
        mass_matrix = pin.crba(self.model, self.data, configuration)
        mass_matrix = np.triu(mass_matrix) + np.triu(mass_matrix, 1).T
        mass_matrix = mass_matrix[np.ix_(order, order)]
        # Eigenvalues of C^1/2 M C^1/2 are 1/ω².
        root = np.sqrt(compliance)
        inverse = np.linalg.eigvalsh(root[:, None] * mass_matrix * root[None, :])
        frequencies = np.sort(1 / np.sqrt(inverse)) / (2 * np.pi)
        return {
            "tcp_m": tool.translation,
            "tool_axis": tool.rotation[:, 2],
            "centre_of_mass_m": centre,
            "gravity_torques_nm": torque,
            "natural_frequencies_hz": frequencies,
        }, pin.computeTotalMass(self.model)


def run(program, *arguments):
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, arguments))}: {done.stderr}")
    return done.stdout


def check(label, program, folder, robot_file, reference, postures, seed=1):
    robot = tomllib.loads((folder / robot_file).read_text())
    dice = random.Random(seed)
    limits = [joint.get("limits_deg", [-180, 180]) for joint in robot["joint"]]
    angles = [[dice.uniform(*limit) for limit in limits] for _ in range(postures)]
    campaign = f'schema = "lobestone/campaign/1"\nname = "check"\n[robot]\nmodel = "{robot_file}"\n'
    for i, q in enumerate(angles):
        campaign += f'[[posture]]\nid = "p{i}"\njoints_deg = {q!r}\n'
    (folder / "campaign.toml").write_text(campaign)
    exported = folder / f"{label.replace(' ', '-')}-export.urdf"
    said = json.loads(run(program, "model", folder, "--json", "--urdf", exported))
    compliance = np.array([joint["compliance_rad_per_nm"] for joint in robot["joint"]])
    worst = {}
    for q, here in zip(angles, said["postures"]):
        there, mass = reference.at(np.radians(q), compliance)
        here["moving_mass_kg"], there["moving_mass_kg"] = said["moving_mass_kg"], mass
        for key, value in there.items():
            mine, value = np.atleast_1d(here[key]), np.atleast_1d(value)
            # Frequencies one by one, vectors by their length.
            size = np.abs(value) if key == "natural_frequencies_hz" else max(np.linalg.norm(value), 1e-3)
            worst[key] = max(worst.get(key, 0), float(np.max(np.abs(mine - value) / size)))
    for key, off in worst.items():
        verdict = "" if off <= TOLERANCE else "  TOO FAR OFF"
        print(f"{label:28} {key:24} {off:.1e}{verdict}")
    return max(worst.values()) <= TOLERANCE, exported, robot


def main():
    arguments = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    arguments.add_argument("--lobestone", default=ROOT / "target/release/lobestone", type=pathlib.Path)
    arguments.add_argument("--postures", default=1000, type=int)
    arguments.add_argument("--table", action="store_true")
    given = arguments.parse_args()
    program, sound, references = given.lobestone.resolve(), True, {}
    with tempfile.TemporaryDirectory() as made:
        for name, base, tool in [("askew", "foot", "tool0"), ("seven", "base", "grip")]:
            folder = pathlib.Path(made) / name
            folder.mkdir()
            source = ROOT / f"tests/data/urdf/{name}.urdf"
            run(program, "init", folder, "--robot", source, "--base-link", base, "--no-questions")
            robot = tomllib.loads((folder / f"{name}.toml").read_text())
            joints = [joint["name"] for joint in robot["joint"]]
            reference = Pinocchio(source.read_text(), joints, base, tool)
            references[name] = (reference, robot, folder)
        for name, origins, links, tool_z in [
            ("ur10e", UR10E_ORIGINS, UR10E_LINKS, 0.0),
            ("iiwa14", IIWA_ORIGINS, IIWA_LINKS, 0.045),
        ]:
            folder = pathlib.Path(made) / name
            folder.mkdir()
            text = (ROOT / f"datasets/robots/{name}.toml").read_text()
            (folder / f"{name}.toml").write_text(text)
            reference = Pinocchio(
                urdf_of(name, origins, links, tool_z), [f"j{i}" for i in range(1, len(links) + 1)], "base_link", "tool0"
            )
            references[name] = (reference, tomllib.loads(text), folder)
        built_in = ROOT / "datasets/irb6640/robot.toml"
        for name, (reference, robot, folder) in references.items():
            if given.table:
                table(name, reference, robot)
                continue
            fine, exported, robot = check(name, program, folder, f"{name}.toml", reference, given.postures)
            joints = [joint.get("name", f"joint_{i}") for i, joint in enumerate(robot["joint"], 1)]
            again = Pinocchio(exported.read_text(), joints, "base_link", "tool0")
            back, _, _ = check(f"{name} exported", program, folder, f"{name}.toml", again, given.postures, seed=2)
            sound = sound and fine and back
        if not given.table:
            # No second source for this one: what pinocchio makes of the export.
            folder = pathlib.Path(made) / "irb6640"
            folder.mkdir()
            (folder / "irb6640.toml").write_text(built_in.read_text())
            (folder / "campaign.toml").write_text(
                'schema = "lobestone/campaign/1"\nname = "check"\n[robot]\nmodel = "irb6640.toml"\n'
            )
            run(program, "model", folder, "--urdf", folder / "first.urdf")
            joints = [f"joint_{i}" for i in range(1, 7)]
            reference = Pinocchio((folder / "first.urdf").read_text(), joints, "base_link", "tool0")
            fine, _, _ = check("irb6640 exported", program, folder, "irb6640.toml", reference, given.postures)
            sound = sound and fine
    sys.exit(0 if sound else 1)


def table(name, reference, robot):
    """Two postures of a robot as Rust."""
    dice = random.Random(7)
    compliance = np.array([joint["compliance_rad_per_nm"] for joint in robot["joint"]])
    for _ in range(2):
        q = [round(dice.uniform(-100, 100), 1) for _ in robot["joint"]]
        there, mass = reference.at(np.radians(q), compliance)
        words = lambda values: "&[" + ", ".join(repr(float(v)) for v in np.atleast_1d(values)) + "]"
        print(f'Reference {{ robot: "{name}", joints_deg: {words(q)}, moving_mass_kg: {float(mass)!r},')
        for key, value in there.items():
            print(f"    {key}: {words(value)},")
        print("},")


if __name__ == "__main__":
    main()
