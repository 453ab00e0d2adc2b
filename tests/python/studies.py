"""A study by executors of Python: processes, and Dask's own; the bytes of this machine.

    studies.py MUPRIME FOLDER

MUPRIME_BINARY names the binary. Ends with an error where something is not so.
"""

import json
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

from distributed import Client, LocalCluster

import muprime

MUPRIME, FOLDER = sys.argv[1], Path(sys.argv[2])
CASES = FOLDER / "noop.jsonl"


def told(*words: str) -> dict:
    return json.loads(subprocess.run([MUPRIME, "--json", *words], check=True, capture_output=True, text=True).stdout)


def main() -> None:
    told("cases", "noop", "--cases", "60", "--hashes", "1000", "-o", str(CASES))
    told("submit", str(CASES), "--out", str(FOLDER / "local"))
    wanted = told("gather", str(FOLDER / "local"))["sha256"]

    with ProcessPoolExecutor(2) as pool:
        study = muprime.study(CASES, FOLDER / "pool", pool, workers=2)
        assert len(study.futures) == 8 == len(study.plan["tasks"])
        found = study.gather()
        assert (found.sha256, found.cases, found.failed) == (wanted, 60, 0) and found.file.exists()
        # Called again it has nothing to do.
        assert muprime.study(CASES, FOLDER / "pool", pool).futures == ()

        # A task that fails says why, and what is there stays.
        study = muprime.study(CASES, FOLDER / "torn", pool, workers=2, case_s=1, task_s=5)
        study.futures[0].result()
        other = told("cases", "noop", "--cases", "60", "--hashes", "7", "-o", str(CASES))
        assert other["cases"] == 60
        broken = muprime.Study(study.out, (pool.submit(subprocess.check_output, study.plan["tasks"][1]["argv"], stderr=-1),), {})
        try:
            broken.gather()
        except muprime.MuprimeError as why:
            assert "results of two studies do not mix" in " ".join(str(why).replace("│", " ").split()), why
        else:
            raise AssertionError("a failing task was not raised")
    told("cases", "noop", "--cases", "60", "--hashes", "1000", "-o", str(CASES))

    with LocalCluster(n_workers=2, threads_per_worker=1, processes=True, dashboard_address=None) as cluster, Client(cluster) as client:
        assert muprime.study(CASES, FOLDER / "dask", client.get_executor(), workers=2).gather().sha256 == wanted
    try:
        muprime.study(FOLDER / "none", FOLDER / "out", None)
    except muprime.MuprimeError as why:
        assert "none" in str(why), why
    else:
        raise AssertionError("a file that is not there was taken")
    print("ok")


if __name__ == "__main__":
    main()
