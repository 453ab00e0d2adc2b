"""Hands the tasks of a job of muprime to HyperQueue or to Dask, and stays until they have ended.

usage: python -c SCRIPT JOB_FOLDER [ID...]    (with the ids of a HyperQueue job: waits for it)

The job comes by the standard input, as `muprime submit` writes job.json. The first line on standard output is a JSON list with the names of the job.
"""

import sys

# Nothing is imported from the folder that the command is called in: others may write to it.
sys.path[:] = [place for place in sys.path if place]

import json
import subprocess
from pathlib import Path


def commands(job):
    """The worker's command for every range."""
    return [[*job["command"], "--range", f"{r['start']}..{r['end']}"] for r in job["ranges"]]


def told(ids):
    """Names the job."""
    print(json.dumps(ids), flush=True)


def hyperqueue(folder, job, ids):
    """One task a range; a worker that is lost does not fail its task, HyperQueue runs it again."""
    from hyperqueue import Client, Job
    from hyperqueue.ffi.protocol import ResourceRequest

    client = Client(job["server"])
    if ids:
        told(ids)
        return not client.connection.wait_for_jobs([int(i) for i in ids], lambda _: None)
    tasks = Job(name=f"muprime-{job['kind']}", max_fails=None, default_workdir=str(folder))
    for command in commands(job):
        tasks.program(command, resources=ResourceRequest(cpus=1), stdout=None, stderr=None)
    submitted = client.submit(tasks)
    told([str(submitted.id)])
    return not client.connection.wait_for_jobs([submitted.id], lambda _: None)


def run(command):
    """Runs one range on a worker of Dask."""
    done = subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"status {done.returncode}: {done.stderr[-2000:]}")


def dask(folder, job, ids):
    """One future a range; Dask runs those of a worker that was lost again."""
    from distributed import Client, as_completed

    with Client(job["server"]) as client:
        futures = client.map(run, commands(job), pure=False, retries=2)
        told([str(client.id)])
        good = True
        for future in as_completed(futures):
            if future.status != "finished":
                print(future.exception(), file=sys.stderr, flush=True)
                good = False
        return good


def main():
    folder, ids = Path(sys.argv[1]), sys.argv[2:]
    job = json.load(sys.stdin)
    engine = {"hq": hyperqueue, "dask": dask}[job["engine"]]
    sys.exit(0 if engine(folder, job, ids) else 1)


if __name__ == "__main__":
    main()
