"""Kill the workers of a batch again and again, and compare what they leave with a batch that was never interrupted.

    python3 scripts/batch/test_resume.py [--engine array,snakemake,dask,ray,slurm,snakemake-slurm] [--campaigns 200] [--lobestone PROGRAM]

Makes many tiny campaigns (one of ten broken) and works on them in one go. Then, with each engine, the same again: some rounds in
which single workers are killed (SIGKILL) while the engine runs, until the engine with all its workers is killed, too, as a power
cut would, and one result is cut in half; and a last round in which workers are killed and the engine has to come to the end by
itself. Fails unless every result that was there before a kill is left as it was, no row is lost or double, the merged table is the
same, cell by cell but for the column `seconds`, as that of the uninterrupted run, and the campaign folders are as they were.

`array` runs scripts/batch/array.sbatch as Slurm would, two tasks at a time, and hands it in again until no task fails; the others
are the recipes of this folder, and need what these need. `slurm` hands the array to a real Slurm whose nodes are this machine (their processes
are killed here), `snakemake-slurm` has Snakemake do so. Python 3.10 or newer; Linux.
"""

import argparse
import csv
import getpass
import hashlib
import random
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(ROOT / "scripts"))
from power_cut import kill, kill_all_of, need, processes  # noqa: E402

# What runs at the same time.
JOBS = 2

# Where every other second a worker is killed, a shard of a slow machine loses more of them than a recipe begins again for. That an
# engine gives up is not what is tested here.
RETRIES = 100


def digest(folder):
    """Names and contents of all files below a folder."""
    found = hashlib.sha256()
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        found.update(str(path.relative_to(folder)).encode() + b"\0" + path.read_bytes())
    return found.hexdigest()


def thinned(source, to, posture="p1"):
    """A copy of a campaign with one of its postures."""
    shutil.copytree(source, to)
    toml = to / "campaign.toml"
    tables = re.split(r"(?m)^(?=\[)", toml.read_text())
    others = [t for t in tables if re.search(r'^(id|posture) = "', t, re.M) and f'"{posture}"' not in t]
    toml.write_text("".join(t for t in tables if t not in others))
    for table in others:
        for name in re.findall(r'^file = "(.*)"', table, re.M):
            (to / name).unlink()


def make_campaigns(folder, source, count):
    """Copies of a campaign; every tenth lacks a file. The comment makes each another one."""
    tiny = folder / "source"
    thinned(source, tiny)
    lines = ["campaign,robot,date"]
    for i in range(count):
        name = f"cell {i % 8}/night{i // 8:02d}"
        shutil.copytree(tiny, folder / name)
        toml = folder / name / "campaign.toml"
        toml.write_text(toml.read_text() + f"\n# night {i}\n")
        if i % 10 == 9:
            min(p for p in (folder / name).rglob("*") if p.is_file() and p.suffix != ".toml").unlink()
        lines.append(f"{name},cell{i % 8},2026-11-{1 + i // 8:02d}")
    manifest = folder / "nights.csv"
    manifest.write_text("\n".join(lines) + "\n")
    return manifest


def without_seconds(table):
    with open(table, newline="") as file:
        return [{k: v for k, v in row.items() if k != "seconds"} for row in csv.DictReader(file)]


def results_in(out):
    return {p.name: (p.stat().st_mtime_ns, p.stat().st_ino) for p in (out / "campaigns").glob("[!.]*.json")}


class Engine:
    """How one engine is started, started again after a power cut, and which of its processes are workers."""

    def __init__(self, name, lobestone, manifest, out, wanted, folder):
        self.name, self.lobestone, self.folder = name, lobestone, folder
        self.again, shards, steps = False, wanted.shards, wanted.steps
        python = sys.executable
        recipe = [str(manifest), str(out), "--shards", str(shards), "--do", steps, "--workers", str(JOBS)]
        recipe += ["--retries", str(RETRIES), "--lobestone", lobestone]
        tasks = f"SLURM_ARRAY_TASK_MIN=1 SLURM_ARRAY_TASK_MAX={shards} SLURM_ARRAY_TASK_COUNT={shards} SLURM_CPUS_PER_TASK=1"
        task = [str(HERE / "array.sbatch"), str(manifest), str(out), "--do", steps]
        # A task that fails is no reason to leave the others; all are handed in again.
        one = f"LOBESTONE={shlex.quote(lobestone)} {tasks} SLURM_ARRAY_TASK_ID=$0 bash {shlex.join(task)} || exit 1"
        array = f"until seq 1 {shards} | xargs -P {JOBS} -n 1 bash -c {shlex.quote(one)}; do :; done"
        batch = ["sbatch", "--quiet", "--wait", f"--array=1-{shards}", "--cpus-per-task=1", "--chdir", str(folder), *task]
        slurm = f"export LOBESTONE={shlex.quote(lobestone)}; until {shlex.join(batch)}; do :; done"
        fleet = shlex.join([lobestone, "fleet", str(out)])
        config = [f"manifest={manifest}", f"out={out}", f"shards={shards}", f"do={steps}", f"lobestone={lobestone}"]
        snakemake = [wanted.snakemake, "--snakefile", str(HERE / "Snakefile"), "--directory", str(folder)]
        snakemake += ["--retries", str(RETRIES), "--config", *config]
        # Without a data base of accounts there is no sacct.
        on_slurm = ["--profile", str(HERE / "slurm-profile"), "--slurm-status-command", "squeue", "--slurm-no-account"]
        self.command = {
            "array": ["bash", "-c", f"{array}; {fleet}"],
            "slurm": ["bash", "-c", f"{slurm}; {fleet}"],
            "snakemake": [*snakemake, "--cores", str(JOBS)],
            "snakemake-slurm": [*snakemake, *on_slurm],
            "dask": [python, str(HERE / "dask_batch.py"), *recipe],
            "ray": [python, str(HERE / "ray_batch.py"), *recipe],
        }[name]  # fmt: skip

    def start(self, log):
        of_snakemake = self.name.startswith("snakemake")
        if self.again and of_snakemake:
            subprocess.run([*self.command, "--unlock"], check=True, stdout=log, stderr=log)
        command = self.command + (["--rerun-incomplete"] if self.again and of_snakemake else [])
        self.again = True
        return subprocess.Popen(command, start_new_session=True, stdout=log, stderr=log)

    def cut(self, run):
        """The engine and all that it has started, as if the power went."""
        kill_all_of(run)
        if self.name.endswith("slurm"):
            # Its tasks are Slurm's.
            for process in self.workers(run):
                kill(process)
            subprocess.run(["scancel", "--user", getpass.getuser()], check=True)
            while subprocess.run(["squeue", "--noheader"], check=True, capture_output=True).stdout.strip():
                time.sleep(0.1)

    def workers(self, run):
        """The program at work on a shard, and what runs it where an engine has processes for that."""
        of_program = [self.lobestone.encode(), b"--quiet"]
        all_of_it = processes(None if self.name.endswith("slurm") else run.pid)
        of_engine = {
            "dask": lambda words: any(b"spawn_main" in word for word in words),
            "ray": lambda words: words[0].startswith(b"ray::shard"),
        }.get(self.name, lambda words: False)
        at_work = [process for process, words in all_of_it.items() if words[:2] == of_program]
        # Before anything is at work the engine itself is still starting.
        return at_work and at_work + [process for process, words in all_of_it.items() if of_engine(words)]


def killed_and_resumed(engine, out, wanted, dice):
    """Rounds of kills, and the last one to the end. How many workers were killed."""
    count, killed, kept = wanted.campaigns, 0, 0
    # Cut in half and not yet seen to be mended: an engine need not come to that shard in the next round.
    halved = set()
    log = open(engine.folder / "log", "w+")

    def told():
        log.seek(0)
        return log.read()[-4000:]

    for cut in range(wanted.kills):
        there = results_in(out)
        # Until some more are done, so that a slow machine comes to its end as well.
        aim = len(there) + max(1, count // (wanted.kills + 2))
        run = engine.start(log)
        begun = last = time.monotonic()
        while len(results_in(out)) < aim:
            need(run.poll() is None, f"{engine.name} ended early, with status {run.returncode}:\n{told()}")
            need(time.monotonic() - begun < 600, f"{engine.name} did not get to {aim} results:\n{told()}")
            time.sleep(0.02)
            if time.monotonic() - last > 2.0 and (workers := engine.workers(run)):
                kill(dice.choice(workers))
                killed, last = killed + 1, time.monotonic()
        time.sleep(dice.uniform(0, 0.3))
        engine.cut(run)
        now = results_in(out)
        redone = [name for name, when in there.items() if now.get(name) != when]
        need(halved.issuperset(redone), f"results that were there were written again: {set(redone) - halved}")
        halved.difference_update(redone)
        kept += len(there) - len(redone)
        print(f"  power cut {cut + 1}: {len(now)} of {count} results are there, {len(redone)} redone, {killed} workers killed so far")
        # A file cut off by a full disk: the next round has to notice.
        victim = out / "campaigns" / sorted(now)[dice.randrange(len(now))]
        data = victim.read_bytes()
        victim.write_bytes(data[: len(data) // 2])
        halved.add(victim.name)
    need(kept > 0, "nothing was kept over a power cut")
    left = list((out / "campaigns").glob(".lobestone-*"))
    print(f"  {len(left)} half-written files of killed workers lie about")

    begun = last = time.monotonic()
    run, alone = engine.start(log), 0
    while run.poll() is None:
        need(time.monotonic() - begun < 900, f"{engine.name} did not come to its end:\n{told()}")
        time.sleep(0.02)
        if alone < wanted.kills and time.monotonic() - last > 1.0 and (workers := engine.workers(run)):
            kill(dice.choice(workers))
            alone, last = alone + 1, time.monotonic()
    need(run.returncode == 0, f"{engine.name} failed:\n{told()}")
    need(alone > 0, "no worker was killed in the last round")
    print(f"  the rest and the fleet: {time.monotonic() - begun:.1f} s, {alone} workers killed")
    return killed + alone


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--lobestone", default=str(ROOT / "target/release/lobestone"))
    arguments.add_argument("--engine", default="array", help="array, snakemake, dask, ray, slurm or snakemake-slurm; several with commas")
    # The one next to this Python, where there is one.
    beside = Path(sys.executable).with_name("snakemake")
    arguments.add_argument("--snakemake", default=str(beside) if beside.exists() else "snakemake")
    arguments.add_argument("--source", default=str(ROOT / "tests/data/blind/frf-9115"))
    arguments.add_argument("--campaigns", type=int, default=200)
    arguments.add_argument("--shards", type=int, default=20)
    arguments.add_argument("--kills", type=int, default=3, help="power cuts, and workers killed in the last round")
    arguments.add_argument("--steps", default="calibrate")
    arguments.add_argument("--seed", type=int, default=1)
    wanted = arguments.parse_args()
    lobestone = str(Path(wanted.lobestone).resolve())
    dice = random.Random(wanted.seed)

    with tempfile.TemporaryDirectory(prefix="batch-") as folder:
        folder = Path(folder)
        manifest = make_campaigns(folder / "data", Path(wanted.source), wanted.campaigns)
        before = digest(folder / "data")
        # Paths with a blank in them, as people have them.
        once = folder / "at once"
        begun = time.monotonic()
        command = [lobestone, "--quiet", "--jobs", "1", "batch", str(manifest), "--out", str(once), "--do", wanted.steps]
        subprocess.run(command, check=True, stdout=subprocess.DEVNULL)
        whole_s = time.monotonic() - begun
        subprocess.run([lobestone, "fleet", str(once)], check=True, stdout=subprocess.DEVNULL)
        whole = without_seconds(once / "fleet/all.csv")
        print(f"uninterrupted, one worker: {wanted.campaigns} campaigns in {whole_s:.1f} s")

        for name in wanted.engine.split(","):
            print(f"{name}:", flush=True)
            place = folder / name
            place.mkdir()
            out = place / "in pieces"
            begun = time.monotonic()
            engine = Engine(name, lobestone, manifest, out, wanted, place)
            killed = killed_and_resumed(engine, out, wanted, dice)
            merged = without_seconds(out / "fleet/all.csv")
            names = [row["campaign"] for row in merged]
            need(len(set(names)) == len(names) == wanted.campaigns, f"{len(names)} rows of {wanted.campaigns} campaigns")
            need(whole == merged, "the merged tables differ")
            failed = [row for row in merged if row["status"] == "failed"]
            need(len(failed) == wanted.campaigns // 10, f"{len(failed)} failed rows")
            need(all(row["error"] for row in failed), "a failed row without its error")
            need(digest(folder / "data") == before, "a campaign folder was changed")
            print(
                f"  the same merged table, cell by cell, after {wanted.kills} power cuts and {killed} killed workers: {len(merged)} rows,"
                f" {len(failed)} of them failed as they should; {time.monotonic() - begun:.1f} s: holds",
                flush=True,
            )


if __name__ == "__main__":
    main()
