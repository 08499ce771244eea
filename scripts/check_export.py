#!/usr/bin/env python3
"""Reads what `lobestone export` writes with the programs that it is written for: pyuff, scipy, numpy, pandas, openpyxl (and pyarrow,
where Parquet is built in). Every number is held against what the measurement file or the command's own document says.

usage: check_export.py [LOBESTONE [--parquet]]      (needs: pip install pyuff scipy pandas openpyxl, pyarrow for Parquet)
"""

import json
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import openpyxl
import pandas as pd
import pyuff
import scipy.io

ROOT = Path(__file__).resolve().parent.parent
PROGRAM = sys.argv[1] if len(sys.argv) > 1 else str(ROOT / "target/release/lobestone")
STRUCTURE = ROOT / "tests/data/blind/frf-9000"
CUTTING = ROOT / "tests/data/blind/force-9400"


def document(*arguments):
    done = subprocess.run([PROGRAM, *map(str, arguments), "--json"], capture_output=True, text=True)
    if done.returncode != 0:
        raise SystemExit(f"lobestone {' '.join(map(str, arguments))}: {done.stderr}")
    return json.loads(done.stdout)


def near(a, b, what, relative=1e-12):
    a, b = np.asarray(a), np.asarray(b)
    assert a.shape == b.shape, f"{what}: {a.shape} and {b.shape}"
    assert a.size > 0, f"{what}: nothing was compared"
    assert np.array_equal(np.isnan(a), np.isnan(b)), f"{what}: nothing stands elsewhere"
    if np.isnan(a).all():
        return
    scale = np.nanmax(np.abs(b))
    gap = np.nanmax(np.abs(a - b))
    assert gap <= relative * scale, f"{what}: off by {gap} of {scale}"


def complex_of(frame, name):
    return (frame[f"{name}_re_m_per_n"] + 1j * frame[f"{name}_im_m_per_n"]).to_numpy()


def same_table(folder, name, formats):
    """The same table as pandas has it of CSV, of a sheet and of Parquet; that of CSV."""
    csv = pd.read_csv(folder / f"{name}.csv", keep_default_na=False, na_values=[""])
    others = {"xlsx": lambda p: pd.read_excel(p, engine="openpyxl", keep_default_na=False, na_values=[""])}
    if "parquet" in formats:
        others["parquet"] = pd.read_parquet
    for ending, read in others.items():
        other = read(folder / f"{name}.{ending}")
        assert list(other.columns) == list(csv.columns), (ending, list(other.columns), list(csv.columns))
        assert len(other) == len(csv), (ending, len(other), len(csv))
        for column in csv.columns:
            if pd.api.types.is_numeric_dtype(csv[column]):
                near(other[column].astype(float), csv[column].astype(float), f"{name}.{ending} {column}")
            else:
                assert list(other[column].fillna("").astype(str)) == list(csv[column].fillna("").astype(str)), (ending, column)
    book = openpyxl.load_workbook(folder / f"{name}.xlsx", read_only=True)
    assert [c.value for c in next(book.active.iter_rows(max_row=1))] == list(csv.columns)
    return csv


def arrays(folder, name):
    """Arrays of NPZ; those of MAT must be the same."""
    npz = dict(np.load(folder / f"{name}.npz", allow_pickle=False))
    mat = scipy.io.loadmat(folder / f"{name}.mat")
    for key, values in npz.items():
        other = mat[key]
        if values.dtype.kind == "U":
            assert [str(t).rstrip() for t in other.ravel()] == list(values), (name, key)
        else:
            near(other.reshape(values.shape), values, f"{name}.mat {key}", 0.0)
    assert {k for k in mat if not k.startswith("__")} == set(npz)
    return npz


def structure(folder, formats):
    parts = "frf,model,residual,modes,lobes"
    written = document("export", STRUCTURE, "--what", parts, "--format", ",".join(formats), "--out", folder)
    assert all(Path(f["path"]).is_file() for f in written["files"]), written["files"]
    assert [(x["what"], x["format"]) for x in written["left_out"]] == [("lobes", "uff")], written["left_out"]

    # Measured FRFs: pyuff reads the campaign's own file and ours.
    frf = same_table(folder, "frf", formats)
    npz = arrays(folder, "frf")
    first = pyuff.UFF(str(STRUCTURE / "frf/p1.uff")).read_sets()
    ours = [s for s in pyuff.UFF(str(folder / "frf.uff")).read_sets() if s["type"] == 58]
    assert len(ours) == len(frf["frf"].unique())
    of_p1 = frf[frf["posture"] == "p1"]
    for k, theirs in enumerate([s for s in first if s["type"] == 58]):
        response, reference = npz["p1_response"][k], npz["p1_reference"][k]
        one = of_p1[(of_p1["response"] == response) & (of_p1["reference"] == reference)]
        omega = 2 * np.pi * np.asarray(theirs["x"])
        kind = theirs["ordinate_spec_data_type"]
        measured = np.asarray(theirs["data"]) / {8: 1, 11: 1j * omega, 12: -(omega**2)}[kind]
        near(one["frequency_hz"], theirs["x"], "lines", 1e-6)
        near(complex_of(one, "receptance"), measured, "receptance", 1e-6)
        near(npz["p1_receptance_m_per_n"][k], complex_of(one, "receptance"), "npz")
        # The same order; twelve digits.
        near(ours[k]["data"], npz["p1_receptance_m_per_n"][k], "uff", 1e-11)
        assert ours[k]["ordinate_spec_data_type"] == 8 and ours[k]["rsp_node"] == theirs["rsp_node"]
        assert ours[k]["rsp_dir"] == theirs["rsp_dir"] and ours[k]["ref_dir"] == theirs["ref_dir"]

    # Model and residual: model - measured, and the error that the command tells.
    model, residual = same_table(folder, "model", formats), same_table(folder, "residual", formats)
    m, r = arrays(folder, "model"), arrays(folder, "residual")
    assert m["p1_model_m_per_n"].shape == r["p1_residual_m_per_n"].shape
    measured = m["p1_model_m_per_n"] - r["p1_residual_m_per_n"]
    same_lines = np.isin(np.round(npz["p1_frequency_hz"], 9), np.round(m["p1_frequency_hz"], 9))
    near(measured, npz["p1_receptance_m_per_n"][:, same_lines], "model - residual")
    gap, whole = complex_of(residual, "residual"), complex_of(model, "model")
    nrms = np.sqrt(np.sum(np.abs(gap) ** 2) / np.sum(np.abs(whole - gap) ** 2))
    near([nrms], [document("compare", STRUCTURE)["error"]["nrms"]], "nrms", 1e-6)
    assert np.all(r["p1_noise_std_m_per_n"] > 0)
    near(pyuff.UFF(str(folder / "residual.uff")).read_sets(0)["data"], r["p1_residual_m_per_n"][0], "residual.uff", 1e-11)
    near(pyuff.UFF(str(folder / "model.uff")).read_sets(0)["data"], m["p1_model_m_per_n"][0], "model.uff", 1e-11)

    # Modes and shapes.
    modes, shapes = same_table(folder, "modes", formats), same_table(folder, "shapes", formats)
    told = document("modal", STRUCTURE)["global"]
    near(modes["frequency_hz"], [t["frequency_hz"] for t in told], "modes")
    near(modes["damping_ratio"], [t["damping_ratio"] for t in told], "damping")
    near(arrays(folder, "modes")["frequency_hz"], modes["frequency_hz"], "modes.npz")
    s = arrays(folder, "shapes")
    of_p1 = shapes[(shapes["posture"] == "p1") & (shapes["mode"] == 1)]
    near(s["p1_shape"][0], (of_p1["re"] + 1j * of_p1["im"]).to_numpy(), "shape")
    assert list(s["p1_dof"]) == list(of_p1["dof"])
    sets = pyuff.UFF(str(folder / "modes-p1.uff")).read_sets()
    kinds = [x["type"] for x in sets]
    assert 15 in kinds and 55 in kinds, kinds
    count = int((modes["posture"] == "p1").sum())
    assert kinds.count(55) == count
    damped = [abs(x["eig"].imag) / 2 / np.pi / np.sqrt(1 - z**2)
              for x, z in zip([x for x in sets if x["type"] == 55], modes["damping_ratio"])]
    near(damped, modes["frequency_hz"][:count], "modes.uff", 1e-4)
    sets = pyuff.UFF(str(folder / "geometry-p1.uff")).read_sets()
    # One dataset is no list.
    nodes = next(x for x in (sets if isinstance(sets, list) else [sets]) if x["type"] == 2411)
    tcp = document("model", STRUCTURE)["postures"][0]["tcp_m"]
    at = list(np.asarray(nodes["node_nums"]).ravel()).index(1)
    near([nodes["x"][at], nodes["y"][at], nodes["z"][at]], tcp, "geometry", 1e-9)

    # Lobes.
    lobes = same_table(folder, "lobes", formats)
    curve = document("lobes", STRUCTURE)["curves"][0]
    one = lobes[lobes["posture"] == curve["posture"]]
    near(one["spindle_rpm"], curve["spindle_rpm"], "speeds")
    limits = np.array([np.nan if x is None else x for x in curve["depth_limit_mm"]], dtype=float)
    near(one["depth_limit_mm"], limits, "limits")
    near(arrays(folder, "lobes")["depth_limit_mm"], lobes["depth_limit_mm"], "lobes.npz")


def cutting(folder, formats):
    document("export", CUTTING, "--format", ",".join(formats), "--out", folder)
    table = same_table(folder, "coefficients", formats)
    told = document("cfc", CUTTING)["pooled"]
    pooled = table[table["group"] == "all speeds"]
    for _, row in pooled.iterrows():
        group = next(g for g in told if g["process"] == row["process"])
        near([row["value"]], [group[row["coefficient"]]["value"]], row["coefficient"])
        near([row["std_error"]], [group[row["coefficient"]]["std_error"]], row["coefficient"])
    assert len(pooled) == 6, pooled

    # A record, as the campaign's own text file has it.
    record = same_table(folder, "record-01", formats)
    lines = (CUTTING / "force/cut01.txt").read_text().splitlines()
    rows = [l.replace(",", ".").split(";") for l in lines if l[:1].isdigit() or l[:2] in ("-0",)]
    theirs = np.array([[float(c) for c in r[:4]] for r in rows if len(r) >= 4])
    near(record[["time_s", "fx_n", "fy_n", "fz_n"]].to_numpy(), theirs, "record", 1e-6)
    sets = [s for s in pyuff.UFF(str(folder / "record-01.uff")).read_sets() if s["type"] == 58]
    assert len(sets) == record.shape[1] - 1
    near(sets[0]["data"], record["fx_n"], "record.uff", 1e-11)
    near(arrays(folder, "record-01")["fx_n"], record["fx_n"], "record.npz")


def main():
    formats = ["csv", "uff", "mat", "npz", "xlsx"]
    # Asked for, until it has been run once: no program with Parquet was at hand when this was written.
    if "--parquet" in sys.argv:
        formats.append("parquet")
    with tempfile.TemporaryDirectory() as folder:
        structure(Path(folder) / "structure", formats)
        cutting(Path(folder) / "cutting", formats)
    print(f"read back by other programs: {', '.join(formats)}")


main()
