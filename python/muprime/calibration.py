"""Calibration: data in, a dated and hashed certificate with uncertainties out; and the skin of a finger from a phase table."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from . import _muprime
from ._tables import csv_bytes


@dataclass(frozen=True)
class CertifiedParameter:
    """A parameter of a certificate."""

    name: str
    value: float
    unit: str
    standard_uncertainty: float
    ci95: tuple[float, float]
    """Its interval of 95 %."""


@dataclass(frozen=True)
class Certificate:
    """A certificate: ``toml`` is the file's text, with covariance, budget and hashes."""

    kind: str
    """``force``, ``amplitude``, ``latency``, ``phase``, ``finger``, ``creep`` and so on."""
    serial: str
    """The instrument that it holds for."""
    parameters: tuple[CertifiedParameter, ...]
    valid_until: str
    """RFC 3339 in UTC."""
    remarks: tuple[str, ...]
    content_sha256: str
    skin: dict[str, Any] | None = field(repr=False)
    """Of a finger with a phase table: what ``muprime calibrate finger --json`` says under that key."""
    toml: str = field(repr=False)

    def __getitem__(self, name: str) -> CertifiedParameter:
        """The parameter of that name."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise KeyError(f"{name!r}: this certificate has {', '.join(p.name for p in self.parameters)}")

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes it; a file that exists is refused."""
        with open(path, "x", encoding="utf-8") as out:
            out.write(self.toml)


def _certificate(toml: str, document: str) -> Certificate:
    told = json.loads(document)
    return Certificate(
        kind=told["kind"],
        serial=told["serial"],
        parameters=tuple(
            CertifiedParameter(
                p["name"], p["value"], p["unit"], p["standard_uncertainty"], (p["ci95"][0], p["ci95"][1])
            )
            for p in told["parameters"]
        ),
        valid_until=told["valid_until"],
        remarks=tuple(told["remarks"]),
        content_sha256=told["content_sha256"],
        skin=told["skin"] if told.get("skin", {}).get("elastic") else None,
        toml=toml,
    )


def calibrate(kind: str, *files: str | os.PathLike[str], operator: str, serial: str, **options: Any) -> Certificate:
    """Makes a certificate from files, as ``muprime calibrate KIND`` does: same checks, same numbers; :meth:`Certificate.save` writes it.

    ``kind``: ``force``, ``amplitude``, ``latency``, ``phase``, ``finger``, ``creep``, ``gravity``, ``noise``, ``step`` or ``tap``. ``files`` and ``options``
    are those of the command (``muprime calibrate KIND --help``), with underscores: ``normal_loop="loop.csv"``, ``gravity_m_s2=9.81``,
    ``quadratic=True``, ``modulus_range_pa=(10e6, 1e9)``. A certificate names its files with a hash over them: data frames are
    not taken. What opens instruments is refused: ``muprime calibrate`` does that, with the operator at the bench.
    """
    words = [kind, f"--operator={operator}", f"--serial={serial}"]
    for name, value in options.items():
        flag = f"--{name.replace('_', '-')}"
        if value is None or value is False:
            continue
        if value is True:
            words.append(flag)
        elif isinstance(value, (list, tuple)):
            words += [flag, *(_word(one) for one in value)]
        else:
            words.append(f"{flag}={_word(value)}")
    # A file is a file, whatever its name begins with.
    words += ["--", *(os.fspath(one) for one in files)] if files else []
    return _certificate(*_muprime.calibrate(words))


def _word(value: Any) -> str:
    return os.fspath(value) if isinstance(value, os.PathLike) else str(value)


def load_certificate(path: str | os.PathLike[str]) -> Certificate:
    """Reads a certificate. One whose hash does not hold, whose numbers cannot be, or whose time is over is refused."""
    text = Path(path).read_text(encoding="utf-8")
    return _certificate(text, _muprime.certificate(os.fspath(path), text))


@dataclass(frozen=True)
class Estimate:
    """A quantity of the skin with its 95 % profile interval."""

    value: float
    ci95: tuple[float, float]
    closed: tuple[bool, bool]
    """Whether the interval ends within the range searched, below and above."""


@dataclass(frozen=True)
class Skin:
    """What phases tell of the stratum corneum (section 3.3, Eq. 2)."""

    young_modulus_pa: Estimate
    """Of elastic skin with the default penalty."""
    residual_rms_deg: float
    """Root mean square of what the elastic fit leaves, in degrees."""
    penalty_ratio: Estimate | None
    """Contact penalty over the modulus, with all three free; none where only the modulus was asked for."""
    retardation_time_s: Estimate | None
    """Retardation time in s, with all three free."""
    free_young_modulus_pa: Estimate | None
    """The modulus, with all three free."""
    cannot_tell: tuple[str, ...]
    """What the data cannot tell, in words."""
    document: dict[str, Any] = field(repr=False)
    """The whole answer: ``skin`` of ``muprime calibrate finger --json``."""


def fit_finger(
    phases: Any,
    *,
    frequency_hz: float | None = None,
    normal_force_n: float | None = None,
    modulus_range_pa: tuple[float, float] = (10e6, 1e9),
    modulus_only: bool = False,
    elements: int = 800,
) -> Skin:
    """Identifies the skin of a finger from a phase table: the ridge is run at the table's amplitudes, and Eq. 2 made least.

    ``phases``: a path (CSV), or a data frame of pandas, polars or Arrow with ``amplitude_pp_m`` (m), ``phase_shift_deg`` (degrees, [0, 360)) and, where known,
    ``phase_shift_sd_deg``, ``repeats``, ``frequency_hz``, ``normal_force_n``. Frequency and force are given where the table has no such
    column. Takes a minute or two of all cores on the default mesh, a quarter of that with ``modulus_only``.
    """
    data = Path(phases).read_bytes() if isinstance(phases, (str, os.PathLike)) else csv_bytes(phases)
    told = json.loads(
        _muprime.fit_finger(data, frequency_hz, normal_force_n, modulus_range_pa, elements, modulus_only)
    )
    elastic, free = told["elastic"], told["all_free"]

    def estimate(name: str) -> Estimate | None:
        if free is None:
            return None
        found = free[name]
        return Estimate(found["best"], tuple(found["ci95"]), tuple(found["closed"]))

    return Skin(
        young_modulus_pa=Estimate(
            elastic["young_modulus_pa"], tuple(elastic["ci95_pa"]), tuple(elastic["closed"])
        ),
        residual_rms_deg=elastic["residual_deg"][0],
        penalty_ratio=estimate("penalty_ratio"),
        retardation_time_s=estimate("retardation_time_s"),
        free_young_modulus_pa=estimate("young_modulus_pa"),
        cannot_tell=tuple(elastic["cannot_tell"]) + tuple(free["cannot_tell"] if free else ()),
        document=told,
    )
