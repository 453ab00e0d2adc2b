"""A user's own law as a table: computed once by a function, checked against fresh calls, read by the loop and the diagnosis."""

from __future__ import annotations

import inspect
import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from . import _muprime


@dataclass(frozen=True)
class LawTable:
    """A law as a table."""

    name: str
    """Name in records and verdicts."""
    text: str
    """The file: CSV with a header that says where it comes from."""
    sha256: str
    """Hash of its rows, by which records and verdicts name it."""
    error_greatest: float
    """Greatest difference of table and fresh calls in mu'."""
    error_greatest_at: str
    """Where it is."""
    error_rms: float
    """Root mean square of the differences; it is in the table's uncertainty."""
    checks: int
    """Number of fresh calls."""

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Writes the file, for ``muprime.run(model=path)`` and ``muprime run --model``."""
        path = Path(path)
        path.write_text(self.text, encoding="utf-8")
        return path


def tabulate(
    law: Callable[..., Any],
    grid: Mapping[str, ArrayLike],
    *,
    name: str | None = None,
    tolerance: float = 0.02,
    checks: int = 512,
) -> LawTable:
    """Tabulates a law.

    ``law`` is called once, with an array for each variable of ``grid`` by its name (``amplitude_pp_m``, ``frequency_hz``, ``speed_m_s``,
    ``normal_force_n``, ``mu0``). It returns mu' as an array, or a pair of arrays: mu' and its standard uncertainty. ``grid`` holds the nodes of
    each variable. A variable without nodes is one that the law does not depend on.

    The table is checked against ``checks`` fresh values between the nodes. A greatest difference above ``tolerance`` is refused.
    """
    nodes = [(key, np.asarray(values, dtype=np.float64).tolist()) for key, values in grid.items()]
    columns, values = _muprime.law_conditions(nodes, checks)
    answer = law(**{column: np.array(own) for column, own in zip(columns, values, strict=True)})
    pair: Sequence[Any] = answer if isinstance(answer, tuple) else (answer, 0.0)
    mu, sd = (np.broadcast_to(np.asarray(part, dtype=np.float64), (len(values[0]),)) for part in pair)
    called: str = name or getattr(law, "__name__", type(law).__name__).strip("<>")
    module = getattr(law, "__module__", None)
    answers = list(zip(mu.tolist(), sd.tolist(), strict=True))
    text, about = _muprime.law_table(nodes, checks, answers, f"Python function {module}.{called}", tolerance)
    found = json.loads(about)
    return LawTable(
        name=called,
        text=text,
        sha256=found["sha256"],
        error_greatest=found["error_greatest"],
        error_greatest_at=found["error_greatest_at"],
        error_rms=found["error_rms"],
        checks=found["checks"],
    )


Model = str | os.PathLike[str] | LawTable | Callable[..., Any]
"""What leads a diagnosis: a built-in law's name, a file, a tabulated law, or a function as :func:`tabulate` takes it."""


def base_law(model: Model, tables: list[tuple[str, bytes, str | None]]) -> tuple[str, str | None]:
    """A base law as the crates take it: its name or path, and its text where it is not a file."""
    if isinstance(model, (str, os.PathLike)):
        return os.fspath(model), None
    if not isinstance(model, LawTable):
        if len(tables) > 1:
            raise _muprime.MuprimeError("a function takes its ranges from one table: tabulate it first (tabulate)")
        variables = list(inspect.signature(model).parameters)
        model = tabulate(model, dict(_muprime.law_grid(*tables[0][:2], variables)))
    return model.name, model.text
