"""A HyperQueue or a Dask of one server and two workers, for tests: says where it is, and ends with its standard input.

usage: cluster.py hq FOLDER | dask FOLDER
"""

import sys


def hyperqueue(folder):
    from hyperqueue.cluster import LocalCluster, WorkerConfig

    with LocalCluster(server_dir=folder) as cluster:
        for _ in range(2):
            cluster.start_worker(WorkerConfig(cores=1))
        print(f"server: {folder}", flush=True)
        sys.stdin.read()


def dask(folder):
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None, local_directory=folder
    ) as cluster:
        print(f"server: {cluster.scheduler_address}", flush=True)
        sys.stdin.read()


if __name__ == "__main__":
    {"hq": hyperqueue, "dask": dask}[sys.argv[1]](sys.argv[2])
