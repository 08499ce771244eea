"""Kill a map of the workspace half way, resume it, and compare it with one that was never interrupted.

    python3 scripts/sweep/test_resume.py [--lobestone target/release/lobestone] [--snakemake snakemake] [--shards 12]

Runs scripts/sweep/Snakefile with two local jobs, kills the whole session (SIGKILL, as a power cut would) when a quarter of
the shards are there, unlocks, runs it again with --rerun-incomplete. Fails unless the shards that were there are left as
they were (but for the two jobs under way at most), and the merged table is the same, byte for byte, as that of one uninterrupted run
in a single shard. Needs Python 3.9 or newer, and Snakemake 8 or newer (pip install snakemake); Linux.
"""

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "scripts"))
from power_cut import kill_all_of, need  # noqa: E402

JOBS = 2


def shards_in(out):
    return {p.name: p.stat().st_mtime_ns for p in (out / "shards").glob("shard-*.parquet")}


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--lobestone", default=str(ROOT / "target/release/lobestone"))
    arguments.add_argument("--snakemake", default="snakemake")
    arguments.add_argument("--campaign", default=str(ROOT / "datasets/campaigns/first-cell"))
    arguments.add_argument("--shards", type=int, default=12)
    arguments.add_argument("--options", default="--angle-step-deg 15", help="the grid, for lobestone sweep")
    wanted = arguments.parse_args()
    lobestone = str(Path(wanted.lobestone).resolve())

    with tempfile.TemporaryDirectory(prefix="sweep-") as folder:
        folder = Path(folder)
        # A path with a space in it, as people have them.
        once, pieces = folder / "at once", folder / "in pieces"

        begun = time.monotonic()
        command = [lobestone, "sweep", wanted.campaign, "--out", str(once), *wanted.options.split()]
        subprocess.run(command, check=True)
        print(f"uninterrupted, one shard: {time.monotonic() - begun:.1f} s")

        workflow = [
            wanted.snakemake, "--snakefile", str(ROOT / "scripts/sweep/Snakefile"), "--directory", str(folder),
            "--cores", str(JOBS), "--config", f"campaign={wanted.campaign}", f"out={pieces}", f"shards={wanted.shards}",
            f"lobestone={lobestone}", f"options={wanted.options}",
        ]  # fmt: skip
        log = open(folder / "log", "w+")
        begun = time.monotonic()
        run = subprocess.Popen(workflow, start_new_session=True, stdout=log, stderr=log)
        enough = max(JOBS + 1, wanted.shards // 4)
        while len(shards_in(pieces)) < enough:
            ended = run.poll() is not None
            if ended or time.monotonic() - begun > 600:
                log.seek(0)
                need(False, f"the workflow did not get to {enough} shards:\n{log.read()}")
            time.sleep(0.02)
        # Snakemake may have put jobs into groups of their own; the session is theirs all the same.
        kill_all_of(run)
        there = shards_in(pieces)
        print(f"killed after {time.monotonic() - begun:.1f} s with {len(there)} of {wanted.shards} shards written")
        need(0 < len(there) < wanted.shards, "the kill came too early or too late: choose other --shards")
        need(not (pieces / "sweep.parquet").exists(), "a merged table of a run that was killed")

        subprocess.run([*workflow, "--unlock"], check=True, stdout=log, stderr=log)
        begun = time.monotonic()
        again = subprocess.run([*workflow, "--rerun-incomplete"], stdout=log, stderr=log)
        if again.returncode != 0:
            log.seek(0)
            need(False, f"the workflow could not be resumed:\n{log.read()}")
        now = shards_in(pieces)
        print(f"resumed: the other shards and the merge in {time.monotonic() - begun:.1f} s")
        need(len(now) == wanted.shards, f"{len(now)} of {wanted.shards} shards")
        redone = [name for name, when in there.items() if now[name] != when]
        # A shard whose job Snakemake had not yet seen end is one of the jobs under way.
        need(len(redone) <= JOBS, f"shards that were there were written again: {redone}")
        need(len(redone) < len(there), "nothing was kept")
        print(f"kept: {len(there) - len(redone)} of the {len(there)} shards that were there; {JOBS} jobs were under way")
        same = (once / "sweep.parquet").read_bytes() == (pieces / "sweep.parquet").read_bytes()
        need(same, "the merged tables differ")
        size = (once / "sweep.parquet").stat().st_size
        print(f"the same merged table, byte for byte ({size} bytes): holds")


if __name__ == "__main__":
    main()
