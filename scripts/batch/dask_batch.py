"""The shards of a batch as tasks of Dask; see README.md next to this file.

    python3 scripts/batch/dask_batch.py nights.csv results --shards 20              # workers on this machine
    python3 scripts/batch/dask_batch.py nights.csv results --scheduler tcp://head:8786

A cluster's workers need the program and the folders under the same paths. pip install "dask[distributed]".
"""

import shards


def main():
    arguments = shards.options(__doc__.splitlines()[0])
    arguments.add_argument("--scheduler", help="address of a running cluster")
    wanted = arguments.parse_args()

    import cloudpickle
    import dask
    from distributed import Client, as_completed

    # A cluster's workers do not have this folder on their path.
    cloudpickle.register_pickle_by_value(shards)
    # How many workers a shard may lose; Dask gives up at three.
    dask.config.set({"distributed.scheduler.allowed-failures": wanted.retries})
    here = {"n_workers": wanted.workers, "threads_per_worker": 1, "dashboard_address": None}
    told = shards.Told(wanted)
    with Client(wanted.scheduler) if wanted.scheduler else Client(**here) as client:
        # Not kept once they are done: what a lost worker has been asked for already need not be done again.
        under_way = as_completed(
            client.submit(shards.shard, command, pure=False, retries=wanted.retries) for command in shards.commands(wanted)
        )
        for task in under_way:
            if task.status == "finished":
                told.well(task.result())
            else:
                told.badly(task.exception())
    told.end()


if __name__ == "__main__":
    main()
