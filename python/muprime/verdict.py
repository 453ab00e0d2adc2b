"""The diagnosis: where simulation and reality part, which effect causes it, how far the gap shrinks."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from . import _muprime
from ._tables import csv_bytes
from .own_law import Model, base_law
from .runs import Run, load


@dataclass(frozen=True)
class Parameter:
    """A parameter of an effect."""

    name: str
    value: float
    unit: str
    ci95: tuple[float, float] | None
    """Its interval of 95 %; `None` where the table adds nothing to what was assumed."""


@dataclass(frozen=True)
class Hypothesis:
    """One explanation with its probability."""

    effects: tuple[str, ...]
    """None of them: no gap. ``unknown``: a cause that is not in the library."""
    probability: float
    alias_class: tuple[str, ...]
    """What the table does not tell from it, itself included."""
    parameters: tuple[Parameter, ...]


@dataclass(frozen=True)
class Region:
    """A part of the operating space that carries gap."""

    share_of_gap: float
    text: str


@dataclass(frozen=True)
class Verdict:
    """A verdict; ``document`` holds every key of ``docs/contract.md``, ``json`` is its text as the command prints it."""

    verdict: str
    """``no_gap``, ``named``, ``ambiguous`` or ``unknown``."""
    text: str
    hypotheses: tuple[Hypothesis, ...]
    regions: tuple[Region, ...]
    shrinkage: float | None
    """Share of the removable gap that the verdict's model closes on held-out passes."""
    shrinkage_ci95: tuple[float, float] | None
    remarks: tuple[str, ...]
    predictions: str | None
    """CSV of the conditions that were to be predicted."""
    model: str | None
    """The corrected model as the text of a TOML file, for ``run(model=...)``; `None` where no effect of the library explains most of the gap."""
    json: str = field(repr=False)
    words: str = field(repr=False)
    """What the command says on a terminal."""
    page: str = field(repr=False)
    """The report, one self-contained HTML page."""

    @property
    def document(self) -> dict[str, Any]:
        """The whole verdict as a dictionary."""
        told: dict[str, Any] = json.loads(self.json)
        return told

    def __str__(self) -> str:
        return self.words

    def _repr_html_(self) -> str:
        # The page brings its own style: a frame keeps it from the notebook's.
        from html import escape

        return f'<iframe srcdoc="{escape(self.page)}" style="width:100%;height:42em;border:1px solid #ccc"></iframe>'


def _interval(ends: list[float] | None) -> tuple[float, float] | None:
    return (ends[0], ends[1]) if ends else None


def _part(table: Any, damage: list[str]) -> tuple[str, bytes, str | None, Path | None]:
    """A table's name and bytes, its run's folder, the rig.toml beside it; what is damaged in the folder is added."""
    if isinstance(table, Run):
        table = table.folder
    if not isinstance(table, (str, os.PathLike)):
        return "the data frame", csv_bytes(table), None, None
    path = Path(table)
    if path.is_dir():
        damage += load(path).damage
        return os.fspath(path / "points.csv"), (path / "points.csv").read_bytes(), os.fspath(path), path / "rig.toml"
    return os.fspath(path), path.read_bytes(), None, path.parent / "rig.toml"


def diagnose(
    table: Any,
    rig: str | os.PathLike[str] | None = None,
    *,
    pairs: bool = True,
    without: list[str] | tuple[str, ...] = (),
    predict: Any = None,
    model: Model | None = None,
    effects: list[str | os.PathLike[str]] | tuple[str | os.PathLike[str], ...] = (),
) -> Verdict:
    """Diagnoses a table of passes, or several of one rig in one state together.

    ``table``: a point table's path (CSV or Parquet), a run (its folder or a :class:`Run`), a data frame with the columns of a point
    table, or a list of these: a run and the further passes that its verdict asked for count as one table. ``rig``: path of the rig.toml that states what is calibrated; by default the one beside the table. ``pairs=False`` tries
    single effects only, ``without`` leaves effects out. ``predict``: conditions, a path or a data frame. ``model``: the base law in place of the
    spring-slider: ``'psi'``, ``'surrogate'``, a file, a :class:`LawTable`, or a function as :func:`tabulate` takes it. A function is
    tabulated over the ranges of the table, for the variables that its arguments name. ``effects``: tables of candidate effects of your
    own, CSV or Parquet, each named by its file.

    Bad input is a :class:`MuprimeError` with the row and the remedy.
    """
    damage: list[str] = []
    tables: list[tuple[str, bytes, str | None]] = []
    rigs: list[Path] = [] if rig is None else [Path(rig)]
    for one in table if isinstance(table, (list, tuple)) else [table]:
        name, data, run, beside = _part(one, damage)
        if rig is None and beside is None:
            raise _muprime.MuprimeError("a data frame has no rig.toml beside it: name one with rig=")
        rigs += [beside] if rig is None and beside is not None else []
        tables.append((name, data, run))
    if not tables:
        raise _muprime.MuprimeError("the list of tables is empty")
    stated = [path.read_text(encoding="utf-8") for path in rigs]
    for path, text in zip(rigs, stated):
        if text != stated[0]:
            raise _muprime.MuprimeError(
                f"{rigs[0]} and {path} differ: tables that are diagnosed together are of one rig in one state; "
                "rig= names the file that holds for all"
            )
    if predict is not None:
        predict = Path(predict).read_bytes() if isinstance(predict, (str, os.PathLike)) else csv_bytes(predict)
    law = None if model is None else base_law(model, tables)
    text, words, page, predictions, corrected = _muprime.diagnose(
        tables, os.fspath(rigs[0]), stated[0], pairs, list(without), predict, damage, law,
        [os.fspath(effect) for effect in effects],
    )
    told = json.loads(text)
    return Verdict(
        verdict=told["verdict"],
        text=told["text"],
        hypotheses=tuple(
            Hypothesis(
                effects=tuple(h["effects"]),
                probability=h["probability"],
                alias_class=tuple(h["alias_class"]),
                parameters=tuple(
                    Parameter(p["name"], p["value"], p["unit"], None if p["shape"] == "prior" else _interval(p.get("ci95")))
                    for p in h["parameters"]
                ),
            )
            for h in told["hypotheses"]
        ),
        regions=tuple(Region(r["share_of_gap"], r["text"]) for r in told["where"]["regions"]),
        shrinkage=told["gap"]["shrinkage"],
        shrinkage_ci95=_interval(told["gap"].get("shrinkage_ci95")),
        remarks=tuple(told["remarks"]),
        predictions=predictions,
        model=corrected,
        json=text,
        words=words,
        page=page,
    )
