"""The shards of a batch as tasks of Ray; see README.md next to this file.

    python3 scripts/batch/ray_batch.py nights.csv results --shards 20              # processors of this machine
    python3 scripts/batch/ray_batch.py nights.csv results --address auto           # a running cluster

A cluster's nodes need the program and the folders under the same paths. pip install ray.
"""

import shards


def main():
    arguments = shards.options(__doc__.splitlines()[0])
    arguments.add_argument("--address", help="of a running cluster, or auto")
    wanted = arguments.parse_args()

    import ray

    # A cluster's nodes do not have this folder on their path.
    ray.cloudpickle.register_pickle_by_value(shards)
    here = {"num_cpus": wanted.workers * wanted.threads, "include_dashboard": False}
    ray.init(address=wanted.address, **({} if wanted.address else here))
    task = ray.remote(num_cpus=wanted.threads, max_retries=wanted.retries, retry_exceptions=True)(shards.shard)
    under_way = [task.remote(command) for command in shards.commands(wanted)]
    told = shards.Told(wanted)
    while under_way:
        (ready,), under_way = ray.wait(under_way)
        try:
            told.well(ray.get(ready))
        except ray.exceptions.RayError as error:
            told.badly(error)
    ray.shutdown()
    told.end()


if __name__ == "__main__":
    main()
