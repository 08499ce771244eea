"""Kill the workers of a batch again and again, and compare what they leave with a batch that was never interrupted.

    python3 scripts/batch/test_resume.py [--lobestone target/release/lobestone] [--campaigns 40] [--snakemake snakemake]

Makes many tiny campaigns (one of ten broken), starts a worker a shard, kills all of them (SIGKILL, as a power cut would)
after a while, cuts one result in half, and starts them again until they come to their end. Fails unless every result that
was there before a kill is left as it was, no row is lost or double, the merged table is the same, cell by cell but for
the column `seconds`, as that of one uninterrupted run in a single shard, and the campaign folders are as they were. With
--snakemake the workers of the last round are those of scripts/batch/Snakefile. Python 3.9 or newer, nothing else; Linux.
"""

import argparse
import csv
import hashlib
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


def need(holds, what):
    if not holds:
        sys.exit(f"FAILED: {what}")


def digest(folder):
    """Names and contents of all files below a folder."""
    found = hashlib.sha256()
    for path in sorted(p for p in folder.rglob("*") if p.is_file()):
        found.update(str(path.relative_to(folder)).encode() + b"\0" + path.read_bytes())
    return found.hexdigest()


def make_campaigns(folder, source, count):
    """Copies of a campaign; every tenth lacks a file. The comment makes each another one."""
    lines = ["campaign,robot,date"]
    for i in range(count):
        name = f"cell {i % 4}/night{i // 4:02d}"
        shutil.copytree(source, folder / name)
        toml = folder / name / "campaign.toml"
        toml.write_text(toml.read_text() + f"\n# night {i}\n")
        if i % 10 == 9:
            min(p for p in (folder / name).rglob("*") if p.is_file() and p.suffix != ".toml").unlink()
        lines.append(f"{name},cell{i % 4},2026-11-{1 + i // 4:02d}")
    manifest = folder / "nights.csv"
    manifest.write_text("\n".join(lines) + "\n")
    return manifest


def without_seconds(table):
    with open(table, newline="") as file:
        return [{k: v for k, v in row.items() if k != "seconds"} for row in csv.DictReader(file)]


def results_in(out):
    return {p.name: (p.stat().st_mtime_ns, p.stat().st_ino) for p in (out / "campaigns").glob("[!.]*.json")}


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--lobestone", default=str(ROOT / "target/release/lobestone"))
    arguments.add_argument("--snakemake", help="finish with this Snakemake")
    arguments.add_argument("--source", default=str(ROOT / "tests/data/blind/frf-9115"))
    arguments.add_argument("--campaigns", type=int, default=40)
    arguments.add_argument("--shards", type=int, default=4)
    arguments.add_argument("--kills", type=int, default=4)
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
        once, pieces = folder / "at once", folder / "in pieces"

        def batch(out, shard):
            return [lobestone, "--quiet", "--jobs", "1", "batch", str(manifest), "--out", str(out), "--do", wanted.steps,
                    "--shard", shard]  # fmt: skip

        begun = time.monotonic()
        subprocess.run(batch(once, "1/1"), check=True, stdout=subprocess.DEVNULL)
        whole_s = time.monotonic() - begun
        subprocess.run([lobestone, "fleet", str(once)], check=True, stdout=subprocess.DEVNULL)
        print(f"uninterrupted, one worker: {wanted.campaigns} campaigns in {whole_s:.1f} s")

        kept = 0
        for kill in range(wanted.kills):
            there = results_in(pieces)
            workers = [
                subprocess.Popen(batch(pieces, f"{k}/{wanted.shards}"), stdout=subprocess.DEVNULL)
                for k in range(1, wanted.shards + 1)
            ]
            # Until some more are done, so that a slow machine comes to its end as well.
            aim = len(there) + max(1, wanted.campaigns // (wanted.kills + 2))
            while len(results_in(pieces)) < aim and any(w.poll() is None for w in workers):
                time.sleep(0.01)
            time.sleep(dice.uniform(0, 0.3))
            for worker in workers:
                worker.send_signal(signal.SIGKILL)
            for worker in workers:
                worker.wait()
            now = results_in(pieces)
            redone = [name for name, when in there.items() if now.get(name) != when]
            need(len(redone) <= (1 if kill else 0), f"results that were there were written again: {redone}")
            kept += len(there) - len(redone)
            print(f"kill {kill + 1}: {len(now)} of {wanted.campaigns} results are there, {len(redone)} redone")
            # A file cut off by a full disk: the next round has to notice.
            victim = pieces / "campaigns" / sorted(now)[dice.randrange(len(now))]
            data = victim.read_bytes()
            victim.write_bytes(data[: len(data) // 2])
        need(kept > 0, "nothing was kept over a kill")
        left = list((pieces / "campaigns").glob(".lobestone-*"))
        print(f"{len(left)} half-written files of killed workers lie about")

        begun = time.monotonic()
        if wanted.snakemake:
            workflow = [
                wanted.snakemake, "--snakefile", str(ROOT / "scripts/batch/Snakefile"), "--directory", str(folder), "--cores",
                "2", "--config", f"manifest={manifest}", f"out={pieces}", f"shards={wanted.shards}", f"do={wanted.steps}",
                f"lobestone={lobestone}",
            ]  # fmt: skip
            run = subprocess.run(workflow, capture_output=True, text=True)
            need(run.returncode == 0, f"the workflow failed:\n{run.stderr}")
        else:
            for k in range(1, wanted.shards + 1):
                subprocess.run(batch(pieces, f"{k}/{wanted.shards}"), check=True, stdout=subprocess.DEVNULL)
            subprocess.run([lobestone, "fleet", str(pieces)], check=True, stdout=subprocess.DEVNULL)
        print(f"the rest and the fleet: {time.monotonic() - begun:.1f} s")

        whole, merged = (without_seconds(out / "fleet/all.csv") for out in (once, pieces))
        names = [row["campaign"] for row in merged]
        need(len(set(names)) == len(names) == wanted.campaigns, f"{len(names)} rows of {wanted.campaigns} campaigns")
        need(whole == merged, "the merged tables differ")
        failed = [row for row in merged if row["status"] == "failed"]
        need(len(failed) == wanted.campaigns // 10, f"{len(failed)} failed rows")
        need(all(row["error"] for row in failed), "a failed row without its error")
        need(digest(folder / "data") == before, "a campaign folder was changed")
        print(f"the same merged table, cell by cell: {len(merged)} rows, {len(failed)} of them failed as they should: holds")


if __name__ == "__main__":
    main()
