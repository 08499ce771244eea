"""The package as a user of a notebook has it; numbers against closed forms, and against the command of the same wheel."""

import dataclasses
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
import urllib.request
from pathlib import Path

import numpy as np
import pytest

import lobestone
from lobestone import Campaign


def command(*arguments, **options):
    """The command as users start it: the same extension in an interpreter of its own."""
    return subprocess.run([sys.executable, "-m", "lobestone", *arguments], capture_output=True, text=True, **options)


def document(*arguments):
    done = command(*arguments, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def receptance(f, modes):
    """Σ A/(ω_n² − ω² + 2iζω_nω) of (Hz, ζ, A in 1/kg)."""
    w = 2 * np.pi * f
    return sum(a / ((2 * np.pi * fn) ** 2 - w**2 + 2j * z * 2 * np.pi * fn * w) for fn, z, a in modes)


def noisy_set(seed=5):
    f = np.arange(2.0, 90.0, 0.1)
    shapes = np.array([[1.0, 0.6, -0.3], [0.5, -1.0, 0.8]])
    frf = np.array([receptance(f, [(12.0, 0.03, 0.1 * s1), (41.0, 0.02, 0.2 * s2)]) for s1, s2 in shapes.T])
    noise = np.random.default_rng(seed).normal(size=(*frf.shape, 2)) @ [1, 1j]
    return f, frf + 2e-9 * noise, shapes


def test_the_command_is_in_the_wheel():
    assert command("--version").stdout == f"lobestone {lobestone.__version__}\n"
    wrong = command("calibrait", "cell7")
    assert wrong.returncode == 2 and "calibrate" in wrong.stderr
    failed = command("calibrate", "nowhere")
    assert failed.returncode == 1 and "nowhere" in failed.stderr
    assert subprocess.run(["lobestone", "--version"], capture_output=True, text=True).stdout.startswith("lobestone ")


def test_a_calibration_says_what_the_command_says():
    fit, told = Campaign.load("cell3").calibrate(), document("calibrate", "cell3")
    # The next step names the folder, which the one has in full.
    assert fit.next_step and {**fit.document, "next_step": None} == {**told, "next_step": None}
    assert fit.nrms == told["error"]["nrms"] and fit.nrms < fit.nrms_before
    correlation = fit.correlation
    assert np.allclose(np.diag(correlation), 1.0) and np.allclose(correlation, correlation.T)
    std = np.sqrt(np.diag(fit.covariance))
    assert np.allclose(std, [p.std_error for p in fit.parameters])
    assert "error" in repr(fit) and "\n" not in repr(fit)
    assert "<table>" in fit._repr_html_() and "joint-1.stiffness" in fit._repr_html_()
    with pytest.raises(KeyError, match="joint-1.stiffness"):
        fit["joint-one.stiffness"]
    with pytest.raises(dataclasses.FrozenInstanceError):
        fit.nrms = 0.0


def test_the_loop_from_comparison_to_addition():
    cell = Campaign.load("cell7")
    found = cell.diagnose()
    assert (found.verdict, found.label, found.candidates[0].label) == ("effect", "tool-flexibility", "tool-flexibility")
    before = cell.compare()
    grown = cell.add(found.label)
    assert grown.progress and grown.revision == 1 and grown.effects == ["tool-flexibility"]
    after = cell.compare()
    assert after.nrms < 0.1 * before.nrms and set(after.by) == {"posture", "direction", "point"}
    assert [r["revision"] for r in cell.history()] == [0, 1]
    assert cell.undo()["effects"] == []


def test_frfs_are_those_of_the_comparison():
    cell = Campaign.load("cell3")
    frfs, told = cell.frfs(), cell.compare()
    residual, measured = frfs.residual, frfs.measured
    assert residual.dtype == np.complex128 and residual.shape == (len(frfs), frfs.frequency_hz.size)
    assert np.isclose(np.linalg.norm(residual) / np.linalg.norm(measured), told.nrms)
    one = frfs.at("p2")
    assert len(one) == sum(f.posture == "p2" for f in frfs)
    of_posture = np.linalg.norm(one.residual) / np.linalg.norm(one.measured)
    assert np.isclose(of_posture, told.by["posture"]["p2"])
    # With the noise it has, a measured value is off by as much on average.
    assert (frfs[0].noise_std > 0).all()


def test_localise_draws_a_stiffness():
    found = Campaign.load("cell7").localise()
    told = document("localise", "cell7")
    assert found.places[0].place == told["places"][0]["place"]
    known = ~np.isnan(found.dynamic_stiffness)
    assert known.any() and (found.std[known] > 0).all()


def test_forces_of_a_campaign():
    forces, told = Campaign.load("drill3").cfc(), document("cfc", "drill3")
    ktc = forces.pooled[0].coefficients["Ktc"]
    assert ktc.value == told["pooled"][0]["ktc_n_per_mm2"]["value"] and ktc.unit == "N/mm²"
    assert set(forces.groups[0].coefficients) == {"Ktc", "Kte", "Kfc", "Kfe"}
    assert Campaign.load("drill3").compare().domain == "cutting"
    assert Campaign.load("drill3").cfc(robust=True).groups[0].method == "huber"


def test_frames():
    pandas = pytest.importorskip("pandas")
    frame = Campaign.load("cell3").calibrate().to_frame()
    assert isinstance(frame, pandas.DataFrame)
    assert list(frame.columns) == ["parameter", "value", "std_error", "unit", "initial", "at_bound"]
    f, frf, _ = noisy_set()
    assert list(lobestone.modal.fit(frf, f).to_frame().frequency_hz.round()) == [12.0, 41.0]


def test_modes_of_arrays_are_the_true_ones():
    f, frf, shapes = noisy_set()
    modes = lobestone.modal.fit(frf, f)
    assert len(modes) == 2 and modes.verdict == "good"
    for found, std, true in [
        (modes.frequency_hz, modes.frequency_std_hz, [12.0, 41.0]),
        (modes.damping_ratio, modes.damping_std, [0.03, 0.02]),
    ]:
        assert (std > 0).all() and (np.abs(found - true) < 4 * std).all(), (found, std)
    constants = shapes * [[0.1], [0.2]]
    assert (np.abs(modes.modal_constants - constants) < 6 * modes.modal_constants_std).all()
    largest = shapes[np.arange(2), np.abs(shapes).argmax(axis=1)]
    assert np.allclose(modes.shapes, shapes / largest[:, None], atol=0.02)
    frequency_hz, fitted = modes.fitted[0]
    measured = frf[0][np.isin(f, frequency_hz)]
    assert np.linalg.norm(fitted - measured) < 0.02 * np.linalg.norm(measured)


def test_modes_of_arrays_are_those_of_the_command():
    frfs = Campaign.load("cell3").frfs().at("p1")
    modes = lobestone.modal.fit(frfs.measured, frfs.frequency_hz, dofs=frfs.dofs)
    told = [m for m in document("modal", "cell3")["global"] if m["posture"] == "p1"]
    assert np.array_equal(modes.frequency_hz, [m["frequency_hz"] for m in told])
    assert np.array_equal(modes.damping_std, [m["damping_std"] for m in told])
    assert modes.dofs == sorted({name for dof in frfs.dofs for name in dof})
    assert modes.shapes.shape == (len(modes), len(modes.dofs))


def test_zero_order_lobes_have_the_closed_form_limit():
    """One mode along y in a slot: b_lim = −1/(N Ktc/2 · |α_yy|/2π · 2 Re G_min), G the receptance."""
    zeta, stiffness, fn = 0.03, 2e7, 600.0
    ktc, krc, teeth = 700.0, 210.0, 4
    curve = lobestone.lobes.zero_order(
        np.linspace(2000, 12000, 401),
        teeth=teeth,
        ktc_n_per_mm2=ktc,
        krc_n_per_mm2=krc,
        modes=[lobestone.lobes.Mode("y", fn, zeta, stiffness)],
    )
    # α_yy of a slot = −π k_r (half of [−cos 2φ − 2 k_r φ − k_r sin 2φ] over 0…π).
    alpha = -np.pi * krc / ktc
    least = -1.0 / (4 * stiffness * zeta * (1 + zeta))
    limit_mm = 1e3 / (teeth / (4 * np.pi) * ktc * 1e6 * 2 * alpha * least)
    assert curve.absolute_limit_mm == pytest.approx(limit_mm, rel=1e-3)
    assert curve.depth_limit_mm.min() >= 0.999 * curve.absolute_limit_mm
    assert curve.absolute_limit_hz == pytest.approx(fn * np.sqrt(1 + 2 * zeta), rel=1e-3)
    # The same from sampled lines.
    f = np.arange(300.0, 1200.0, 1.0)
    sampled = np.zeros((f.size, 2, 2), complex)
    sampled[:, 1, 1] = 1 / stiffness / (1 - (f / fn) ** 2 + 2j * zeta * f / fn)
    again = lobestone.lobes.zero_order(
        curve.spindle_rpm,
        teeth=teeth,
        ktc_n_per_mm2=ktc,
        krc_n_per_mm2=krc,
        receptance=sampled,
        frequency_hz=f,
    )
    assert again.absolute_limit_mm == pytest.approx(limit_mm, rel=1e-3)


def test_coefficients_of_noisy_averages_lie_within_their_errors():
    feed = np.linspace(0.04, 0.2, 9)
    n_a = 3 * 1.5
    true = {"Ktc": 850.0, "Krc": 280.0, "Kac": 150.0, "Kte": 22.0, "Kre": 14.0, "Kae": 4.0}
    fx = -n_a / 4 * true["Krc"] * feed - n_a / np.pi * true["Kre"]
    fy = n_a / 4 * true["Ktc"] * feed + n_a / np.pi * true["Kte"]
    fz = n_a / np.pi * true["Kac"] * feed + n_a / 2 * true["Kae"]
    noise = np.random.default_rng(3).normal(0, 0.5, (9, 3))
    averages = np.c_[fx, fy, fz] + noise
    found = lobestone.cfc.identify(
        averages, feed_per_tooth_mm=feed, axial_depth_mm=1.5, teeth=3, std_errors_n=0.5, immersion_deg=(0, 180)
    )
    for name, value in true.items():
        estimate, error = found[name]
        assert 0 < error and abs(estimate - value) < 4 * error, name
    assert np.allclose(np.sqrt(np.diag(found.covariance)), found.std_error)
    assert found.std_error_bootstrap.shape == (6,)
    # A spoilt cut does not pull the robust answer.
    averages[4] += [0.0, 60.0, 0.0]
    pulled, robust = (
        lobestone.cfc.identify(averages, feed_per_tooth_mm=feed, axial_depth_mm=1.5, teeth=3, robust=robust)
        for robust in (False, True)
    )
    assert abs(robust["Kte"][0] - 22.0) < abs(pulled["Kte"][0] - 22.0)
    assert abs(pulled.residual[4, 1]) > 30


def test_what_cuts_cannot_tell_is_said():
    one = lobestone.cfc.identify([[-60.0, 200.0, 30.0]], feed_per_tooth_mm=0.1, axial_depth_mm=1.0, teeth=2)
    assert np.isnan(one.value).all() and {"Ktc", "Kte"} <= set(one.inseparable[0]) | set(one.inseparable[1])
    with pytest.raises(lobestone.ComputationError, match="further feeds"):
        lobestone.cfc.identify([[-60.0, 200.0, 30.0]], feed_per_tooth_mm=0.1, axial_depth_mm=1.0, teeth=2, robust=True)


def test_errors_say_file_line_key_and_remedy():
    with open("cell7/campaign.toml", "a") as file:
        file.write("\n[[posture]]\nid = 'p9'\njoints_deg = [1.0, 2.0]\n")
    with pytest.raises(lobestone.InputError) as caught:
        Campaign.load("cell7")
    error = caught.value
    assert error.file.endswith("campaign.toml") and error.line > 1 and "joints_deg" in error.key
    assert error.problem in str(error) and "remedy" in str(error) and error.remedy
    assert isinstance(error, ValueError)
    with pytest.raises(lobestone.LobestoneError):
        Campaign.load("nowhere")
    with pytest.raises(lobestone.InputError):
        Campaign.load("cell3").add("tool-flexibilty")
    f, frf, _ = noisy_set()
    for wrong in [(frf[:, :-1], f), (frf, f[::-1])]:
        with pytest.raises((ValueError, lobestone.LobestoneError)):
            lobestone.modal.fit(*wrong)
    with pytest.raises(ValueError, match="modes, or receptance"):
        lobestone.lobes.zero_order([1000.0], teeth=2, ktc_n_per_mm2=700, krc_n_per_mm2=200)


def test_progress_is_told_and_may_end_the_work():
    told = []
    Campaign.load("cell7").diagnose(progress=lambda *reading: told.append(reading))
    assert told and all(label and 0 <= done <= total for label, done, total in told)

    class Enough(Exception):
        pass

    def enough(label, done, total):
        raise Enough

    with pytest.raises(Enough):
        Campaign.load("cell7").diagnose(progress=enough)


def test_other_python_threads_work_meanwhile():
    counted, ended = [0], threading.Event()

    def count():
        while not ended.is_set():
            counted[0] += 1
            time.sleep(0.001)

    thread = threading.Thread(target=count)
    thread.start()
    began = time.monotonic()
    Campaign.load("cell7").calibrate(starts=0)
    took = time.monotonic() - began
    ended.set()
    thread.join()
    assert counted[0] > 50 * took


def heed_ctrl_c():
    """In the child: what a shell starts in the background ignores the signal, and so would the child."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
@pytest.mark.parametrize("call", ["diagnose", "calibrate", "localise"])
def test_ctrl_c_ends_a_call(call):
    code = f"""
import lobestone, time
cell = lobestone.Campaign.load("cell7")
print("go", flush=True)
try:
    while True:
        cell.{call}()
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""
    child = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, preexec_fn=heed_ctrl_c)
    try:
        assert child.stdout.readline() == "go\n"
        time.sleep(1.0)
        began = time.monotonic()
        child.send_signal(signal.SIGINT)
        said, _ = child.communicate(timeout=60)
        took = time.monotonic() - began
    finally:
        child.kill()
    print(f"{call}: interrupted after {took:.2f} s")
    assert said == "interrupted\n" and child.returncode == 0
    assert took < 5.0


@pytest.mark.skipif(os.name == "nt", reason="signals of POSIX")
def test_ctrl_c_ends_the_command():
    child = subprocess.Popen(
        [sys.executable, "-m", "lobestone", "diagnose", "cell7"], stdout=subprocess.PIPE, preexec_fn=heed_ctrl_c
    )
    try:
        time.sleep(1.0)
        child.send_signal(signal.SIGINT)
        assert child.wait(timeout=5) == -signal.SIGINT
    finally:
        child.kill()


def test_serve_does_its_work_in_another_process_of_the_interpreter():
    child = subprocess.Popen(
        [sys.executable, "-m", "lobestone", "serve", "cell3", "--port", "0", "--json"], stdout=subprocess.PIPE, text=True
    )
    try:
        url = json.loads(child.stdout.readline())["url"]
        assert url.startswith("http://127.0.0.1")

        def get(path):
            with urllib.request.urlopen(url + path, timeout=30) as answer:
                return answer.read().decode()

        token = re.search(r'name="token" content="(\w+)"', get("")).group(1)
        headers = {"Origin": url[: url.index("/", 8)], "X-Lobestone-Token": token}
        order = urllib.request.Request(url + "order", json.dumps({"do": "refresh"}).encode(), headers)
        assert urllib.request.urlopen(order, timeout=30).status < 300
        deadline = time.monotonic() + 120
        while (status := json.loads(get("status")))["job"] is not None:
            assert time.monotonic() < deadline
            time.sleep(0.3)
        assert status["last"]["ok"], status
    finally:
        child.terminate()
        child.wait(timeout=10)


def test_the_package_is_light():
    """The command does not wait for numpy."""
    code = "import sys, lobestone._command; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code]).returncode == 0


def python_blocks(page):
    """Fenced blocks of Python, in the page's order."""
    text = (Path(__file__).resolve().parents[3] / page).read_text(encoding="utf-8")
    return [part.split("\n```", 1)[0] for part in text.split("```python\n")[1:]]


def test_the_page_about_python_does_what_it_says(capsys):
    blocks, names = python_blocks("docs/python.md"), {}
    assert len(blocks) >= 5
    for block in blocks:
        exec(block, names)
    assert names["found"]["Ktc"][0] == pytest.approx(720, rel=0.02)
    assert "revision 1, + tool-flexibility" in capsys.readouterr().out
    assert names["share"] < 0.1 and names["worst"].posture == "p1"


def test_the_example_of_the_readme_does_what_it_says(capsys):
    (block,) = python_blocks("README.md")
    exec(block.replace("tests/data/blind/frf-9000", "cell3"))
    said = capsys.readouterr().out.splitlines()
    assert said[0].startswith("Comparison (structure): error") and said[1].startswith("Modes: ")
