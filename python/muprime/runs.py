"""Runs: their folders, and sweeps on the virtual rig in virtual time."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from . import _muprime
from .plans import Plan

if TYPE_CHECKING:
    import pandas
    import polars
    import pyarrow  # type: ignore[import-untyped]
    import xarray


@dataclass(frozen=True)
class Run:
    """A run: its passes, and what is known of it."""

    folder: Path
    """Where it stands."""
    facts: dict[str, str]
    """What the record's first words say: setup, plan, seed, operator, versions."""
    summary: dict[str, Any] | None
    """How it ended; none for a run that was killed or still goes on."""
    damage: list[str]
    """What is damaged or missing in its folder, in sentences; empty for a whole run."""
    _arrow: bytes = field(repr=False)

    def arrow(self) -> pyarrow.Table:
        """The passes as an Arrow table, without copies; units and meanings in the fields' metadata."""
        return _table(self._arrow)

    def cycles(self, points: Iterable[int] = ()) -> pyarrow.Table:
        """The recorded cycles as an Arrow table: session, loop time, forces, ``mu'``, drive, stage, safety.

        ``points``: numbers of passes, each one of the run's; none: every cycle, also those between passes (some 200 bytes each in memory).
        """
        return _table(_muprime.cycles(self.folder, list(points)))

    def polars(self) -> polars.DataFrame:
        """The passes as a polars data frame."""
        import polars

        frame = polars.from_arrow(self.arrow())
        assert isinstance(frame, polars.DataFrame)
        return frame

    def pandas(self) -> pandas.DataFrame:
        """The passes as a pandas data frame."""
        frame: pandas.DataFrame = self.arrow().to_pandas()
        return frame

    def to_xarray(self, points: Iterable[int] | None = ()) -> xarray.DataTree:
        """Passes and cycles as an xarray tree with the groups ``passes`` and ``cycles``; units, meanings and facts as attributes.

        ``points`` as for :meth:`cycles`; ``None``: the passes alone. ``to_netcdf`` of the tree writes one NetCDF file.
        """
        import xarray

        groups = {"passes": _dataset(self.arrow(), "pass")}
        if points is not None:
            groups["cycles"] = _dataset(self.cycles(points), "cycle")
        tree = xarray.DataTree.from_dict(groups)
        tree.attrs = dict(self.facts)
        return tree

    def units(self) -> dict[str, str]:
        """The unit of each column that has one."""
        fields = self.arrow().schema
        return {f.name: f.metadata[b"unit"].decode() for f in fields if f.metadata and b"unit" in f.metadata}


def _table(held: bytes) -> pyarrow.Table:
    import pyarrow

    with pyarrow.ipc.open_file(pyarrow.BufferReader(held)) as reader:
        return reader.read_all()


def _dataset(table: pyarrow.Table, dimension: str) -> xarray.Dataset:
    """Columns that hold a value somewhere; a number that is missing is NaN, a text that is missing is empty."""
    import xarray

    held = {}
    for field, column in zip(table.schema, table.columns, strict=True):
        about = {key.decode(): value.decode() for key, value in (field.metadata or {}).items()}
        attributes = {"long_name": about.get("description", field.name), "units": about.get("unit", "")}
        if column.null_count < len(column):
            text = str(field.type) == "string"
            values = column.fill_null("").to_numpy().astype("U") if text else column.to_numpy().astype("f8")
            held[field.name] = (dimension, values, {k: v for k, v in attributes.items() if v})
    return xarray.Dataset(held)


def load(run: str | os.PathLike[str]) -> Run:
    """Reads a run's folder. A folder that holds no run is refused."""
    passes, about = _muprime.load(run)
    told = json.loads(about)
    return Run(Path(run), told["facts"], told["summary"], told["damage"], passes)


def run(
    plan: str | os.PathLike[str] | Plan = "first-sweep",
    *,
    out: str | os.PathLike[str],
    setup: str | os.PathLike[str] = "virtual-ideal",
    seed: int | None = None,
    defects: str | os.PathLike[str] | None = None,
    model: str | os.PathLike[str] | None = None,
    operator: str | None = None,
    sample: str | None = None,
    licence: str | None = None,
) -> Run:
    """Runs a plan (a :class:`Plan`, a file or a bundled name) on the virtual rig of a setup, in virtual time, into the folder ``out``.

    ``model``: the law to compare with, ``'spring-slider'``, ``'psi'``, ``'surrogate'`` or a file, as for ``muprime run --model``. An
    unfinished run there is resumed. A real rig is driven by ``muprime run`` alone, never from here.
    """
    plan = plan if isinstance(plan, Plan) else Plan.load(plan)
    _muprime.run(plan.name, plan.toml, os.fspath(setup), out, seed, defects, model, operator, sample, licence)
    return load(out)
