"""Studies of many cases on any executor of Python: a pool of processes or threads, Dask, Ray, joblib's or submitit's."""

from __future__ import annotations

import json
import os
import subprocess
from collections.abc import Iterable
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from . import _muprime
from ._binary import binary


@dataclass(frozen=True)
class Study:
    """A study at work."""

    out: Path
    """Folder of the results: that of ``muprime submit``, ``case`` and ``gather``."""
    futures: tuple[Future[Any], ...]
    """One a task, in the order of the cases; none where every case has a result."""
    plan: dict[str, Any]
    """What was missing, as ``muprime submit --plan --json`` prints it."""

    def gather(self, to: str | os.PathLike[str] | None = None) -> Gathered:
        """Waits for the tasks, and writes all results as one table.

        A task that failed is a :class:`MuprimeError`; the results that are there stay, and :func:`study` runs the others.
        """
        for future in self.futures:
            try:
                future.result()
            except subprocess.CalledProcessError as why:
                raise _muprime.MuprimeError(f"{why} {(why.stderr or b'').decode(errors='replace')}") from why
        found = _answer(["gather", str(self.out), *(["-o", os.fspath(to)] if to is not None else [])])
        return Gathered(Path(found["file"]), found["sha256"], found["cases"], found["failed"])


@dataclass(frozen=True)
class Gathered:
    """The results of a study as one table."""

    file: Path
    """The table, in Parquet."""
    sha256: str
    """Its hash: the same whoever ran the cases."""
    cases: int
    """Cases in it."""
    failed: int
    """Cases without a result, each with its reason in the column ``failed``."""


def study(
    cases: str | os.PathLike[str],
    out: str | os.PathLike[str],
    executor: Executor,
    *,
    workers: int | None = None,
    task_s: float = 300.0,
    case_s: float | None = None,
) -> Study:
    """Hands what is missing of a study to an executor, and returns without waiting.

    ``cases`` is a file of ``muprime cases``, ``out`` the folder of the results, which the executor's machines share. Each task runs the
    ``muprime`` command of this machine on one core, by :func:`subprocess.check_output`: the executor needs nothing of this package.
    ``workers`` (by default the cores of this machine), ``task_s`` and ``case_s`` size the tasks as the options of ``muprime submit`` do.
    """
    sizes: Iterable[tuple[str, float | None]] = (("--workers", workers), ("--task-s", task_s), ("--case-s", case_s))
    words = [word for name, value in sizes if value is not None for word in (name, str(value))]
    plan = _answer(["submit", os.fspath(cases), "--out", os.fspath(out), "--plan", *words])
    run = [executor.submit(subprocess.check_output, task["argv"], stderr=subprocess.PIPE) for task in plan["tasks"]]
    return Study(Path(plan["out"]), tuple(run), plan)


def _answer(words: list[str]) -> dict[str, Any]:
    """The JSON document of the command; what it refuses is raised."""
    done = subprocess.run([binary(), "--json", *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    answer: dict[str, Any] = json.loads(done.stdout) if done.stdout else {}
    if done.returncode != 0:
        raise _muprime.MuprimeError(answer.get("error") or done.stderr.strip())
    return answer
