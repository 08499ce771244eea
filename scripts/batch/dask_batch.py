"""The shards of a batch as tasks of Dask; see README.md next to this file.

    python3 scripts/batch/dask_batch.py nights.csv results --shards 20              # workers on this machine
    python3 scripts/batch/dask_batch.py nights.csv results --scheduler tcp://head:8786

A cluster's workers need the program and the folders under the same paths. pip install "dask[distributed]".
"""

import argparse
import subprocess
import sys
from pathlib import Path


def shard(program, manifest, out, steps, number, of, threads):
    """One shard. What a killed worker had done is found in the results' folder and not done again."""
    command = [program, "--quiet", "--jobs", str(threads), "batch", manifest, "--out", out, "--do", steps]
    done = subprocess.run([*command, "--shard", f"{number}/{of}"], capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"shard {number}/{of}: status {done.returncode}\n{done.stderr}")
    return number


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("manifest", type=Path)
    arguments.add_argument("out", type=Path)
    arguments.add_argument("--shards", type=int, default=20)
    arguments.add_argument("--do", default="calibrate,diagnose", help="the steps")
    arguments.add_argument("--workers", type=int, default=2, help="on this machine")
    arguments.add_argument("--threads", type=int, default=1, help="of the program, a shard")
    arguments.add_argument("--scheduler", help="address of a running cluster")
    arguments.add_argument("--retries", type=int, default=5, help="how often a shard may fail or lose its worker")
    arguments.add_argument("--lobestone", default="lobestone", help="the program, where it is not on the path")
    wanted = arguments.parse_args()

    import dask
    from distributed import Client, as_completed

    # How many workers a shard may lose; Dask gives up at three.
    dask.config.set({"distributed.scheduler.allowed-failures": wanted.retries})
    here = {"n_workers": wanted.workers, "threads_per_worker": 1, "dashboard_address": None}
    with Client(wanted.scheduler) if wanted.scheduler else Client(**here) as client:
        paths = [str(path.resolve()) for path in (wanted.manifest, wanted.out)]
        # Not kept once they are done: what a lost worker has been asked for already need not be done again.
        under_way = as_completed(
            client.submit(
                shard, wanted.lobestone, *paths, wanted.do, number, wanted.shards, wanted.threads,
                pure=False, retries=wanted.retries,
            )
            for number in range(1, wanted.shards + 1)
        )  # fmt: skip
        failed = 0
        for done, task in enumerate(under_way, start=1):
            if task.status == "finished":
                print(f"{done} of {wanted.shards}: shard {task.result()}", flush=True)
            else:
                failed += 1
                print(f"{done} of {wanted.shards}: {task.exception()}", file=sys.stderr, flush=True)
    if failed:
        sys.exit(f"{failed} shards failed: run this again, what is done is not done again")
    sys.exit(subprocess.run([wanted.lobestone, "fleet", str(wanted.out)]).returncode)


if __name__ == "__main__":
    main()
