"""Friction on demand: a target rendered on the virtual rig, and how faithfully."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import _muprime
from .plans import Plan
from .runs import Run, run

Columns = dict[str, NDArray[np.float64]]


@dataclass(frozen=True)
class Group:
    """The passes at one speed, load and drive frequency."""

    speed_m_s: float
    """Speed in m/s."""
    rms: float
    """Root-mean-square difference of measured and wanted mu', cycle by cycle."""
    rms_shifted: float
    """The same once the way by which the measurement comes later is taken out."""
    forward: Columns
    """Means over the passes against position: x_m, wanted, commanded_pp_m, predicted, measured, measured_sd."""
    backward: Columns
    """The same of the way back."""
    transfer: Columns
    """Transfer function from wanted to measured mu': hz, per_m, gain, gain_sd, phase_rad, coherence."""
    document: dict[str, Any]
    """Everything that fidelity.json holds of the group."""


@dataclass(frozen=True)
class Fidelity:
    """How faithfully a run rendered its target."""

    run: Run
    """The run."""
    tolerance: float
    """Difference of mu' that counts as rendered."""
    remarks: list[str]
    """What the rig was not expected to show of the target."""
    groups: list[Group]
    """By speed, load and drive frequency."""


def _columns(rows: list[dict[str, float]]) -> Columns:
    return {name: np.array([row[name] for row in rows]) for name in (rows[0] if rows else {})}


def _group(document: dict[str, Any]) -> Group:
    forward, backward = (_columns(profile) for profile in document["profiles"])
    return Group(
        document["speed_m_s"],
        document["rms"],
        document["rms_shifted"],
        forward,
        backward,
        _columns(document["transfer"]),
        document,
    )


def render(
    plan: str | os.PathLike[str] | Plan = "render-grating",
    *,
    out: str | os.PathLike[str],
    setup: str | os.PathLike[str] = "virtual-ideal",
    seed: int | None = None,
    defects: str | os.PathLike[str] | None = None,
    model: str | os.PathLike[str] | None = None,
) -> Fidelity:
    """Renders the target of a plan with a ``[render]`` section on the virtual rig, in virtual time, into the folder ``out``.

    ``model``: the law that is turned round, as for :func:`muprime.run`. A plan that renders nothing is refused.
    """
    made = run(plan, out=out, setup=setup, seed=seed, defects=defects, model=model)
    document = json.loads(_muprime.fidelity(os.fspath(out)))
    groups = [_group(group) for group in document["groups"]]
    return Fidelity(made, document["tolerance"], document["remarks"], groups)
