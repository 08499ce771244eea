"""What the recipes for engines of this folder share: their options, a shard's work, and the end."""

import argparse
import subprocess
import sys
from pathlib import Path


def options(description):
    """The options of every recipe, to which it adds how a running cluster is reached."""
    arguments = argparse.ArgumentParser(description=description)
    arguments.add_argument("manifest", type=Path)
    arguments.add_argument("out", type=Path)
    arguments.add_argument("--shards", type=int, default=20)
    arguments.add_argument("--do", default="calibrate,diagnose", help="the steps")
    arguments.add_argument("--workers", type=int, default=2, help="on this machine")
    arguments.add_argument("--threads", type=int, default=1, help="of the program, a shard")
    arguments.add_argument("--retries", type=int, default=5, help="how often a shard may fail or lose its worker")
    arguments.add_argument("--lobestone", default="lobestone", help="the program, where it is not on the path")
    return arguments


def commands(wanted):
    """The program's command for each shard, in their order."""
    manifest, out = (str(path.resolve()) for path in (wanted.manifest, wanted.out))
    command = [wanted.lobestone, "--quiet", "--jobs", str(wanted.threads), "batch", manifest, "--out", out, "--do", wanted.do]
    return [[*command, "--shard", f"{number}/{wanted.shards}"] for number in range(1, wanted.shards + 1)]


def shard(command):
    """One shard; which it was. What a killed worker had done is found in the results' folder and not done again."""
    done = subprocess.run(command, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"shard {command[-1]}: status {done.returncode}\n{done.stderr}")
    return command[-1]


class Told:
    """Tells of each shard that has ended, and of the whole."""

    def __init__(self, wanted):
        self.wanted, self.done, self.failed = wanted, 0, 0

    def well(self, shard):
        self.done += 1
        print(f"{self.done} of {self.wanted.shards}: shard {shard}", flush=True)

    def badly(self, error):
        self.done, self.failed = self.done + 1, self.failed + 1
        print(f"{self.done} of {self.wanted.shards}: {error}", file=sys.stderr, flush=True)

    def end(self):
        """Ends the recipe: with the tables of all shards, or with how many failed."""
        if self.failed:
            sys.exit(f"{self.failed} shards failed: run this again, what is done is not done again")
        sys.exit(subprocess.run([self.wanted.lobestone, "fleet", str(self.wanted.out)]).returncode)
