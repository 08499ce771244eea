"""The shards of a batch as tasks of Ray; see README.md next to this file.

    python3 scripts/batch/ray_batch.py nights.csv results --shards 20              # processors of this machine
    python3 scripts/batch/ray_batch.py nights.csv results --address auto           # a running cluster

A cluster's nodes need the program and the folders under the same paths. pip install ray.
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
    arguments.add_argument("--address", help="of a running cluster, or auto")
    arguments.add_argument("--retries", type=int, default=5, help="how often a shard may fail or lose its worker")
    arguments.add_argument("--lobestone", default="lobestone", help="the program, where it is not on the path")
    wanted = arguments.parse_args()

    import ray

    here = {"num_cpus": wanted.workers * wanted.threads, "include_dashboard": False}
    ray.init(address=wanted.address, **({} if wanted.address else here))
    task = ray.remote(num_cpus=wanted.threads, max_retries=wanted.retries, retry_exceptions=True)(shard)
    paths = [str(path.resolve()) for path in (wanted.manifest, wanted.out)]
    under_way = [
        task.remote(wanted.lobestone, *paths, wanted.do, number, wanted.shards, wanted.threads)
        for number in range(1, wanted.shards + 1)
    ]
    failed, done = 0, 0
    while under_way:
        (ready,), under_way = ray.wait(under_way)
        done += 1
        try:
            print(f"{done} of {wanted.shards}: shard {ray.get(ready)}", flush=True)
        except ray.exceptions.RayError as error:
            failed += 1
            print(f"{done} of {wanted.shards}: {error}", file=sys.stderr, flush=True)
    ray.shutdown()
    if failed:
        sys.exit(f"{failed} shards failed: run this again, what is done is not done again")
    sys.exit(subprocess.run([wanted.lobestone, "fleet", str(wanted.out)]).returncode)


if __name__ == "__main__":
    main()
