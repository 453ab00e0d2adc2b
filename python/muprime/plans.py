"""Plans: which passes a sweep makes, and whether a rig takes them."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _muprime


@dataclass(frozen=True)
class Plan:
    """A plan that was read and holds by itself; :meth:`passes` judges it on a setup. See ``muprime init plan`` for every key."""

    name: str
    """File or bundled name, as messages say it."""
    toml: str = field(repr=False)
    """Its text."""
    document: dict[str, Any] = field(repr=False)
    """Its keys with their values, defaults included; SI units, amplitudes peak-to-peak."""

    @classmethod
    def load(cls, plan: str | os.PathLike[str]) -> Plan:
        """Reads a plan: a file, or a bundled name."""
        return _plan(_muprime.plan_load(os.fspath(plan)))

    @classmethod
    def parse(cls, toml: str, name: str = "the plan") -> Plan:
        """Reads a plan's text."""
        return _plan(_muprime.plan_parse(name, toml))

    @classmethod
    def make(
        cls,
        name: str,
        *series: Mapping[str, ArrayLike],
        amplitude_pp_m: float = 2e-6,
        frequency_hz: float = 27.5e3,
        speed_m_s: float = 0.02,
        normal_force_n: float = 0.25,
        position_m: float = 0.0,
        replicates: int = 1,
        directions: Sequence[int] = (1, -1),
        reference_every: int = 8,
        randomise: bool = True,
        seed: int = 0,
        about: str = "",
        settle_s: float = 0.15,
        measure_s: float = 0.25,
        protocol: Mapping[str, Any] | None = None,
    ) -> Plan:
        """Makes a plan of series, each the product of its lists: ``{"amplitude_pp_m": [1e-6, 2e-6], "speed_m_s": [0.01, 0.02]}``.

        The named values (peak-to-peak amplitude in m, Hz, m/s, N, m) hold where a series does not vary them. A pass settles for ``settle_s`` and is
        averaged for ``measure_s``; a reference without vibration comes before every ``reference_every`` conditions. ``protocol`` goes into
        the record as it is.
        """
        lists = [
            {key: value if isinstance(value, str) else np.atleast_1d(value).tolist() for key, value in one.items()}
            for one in series
        ]
        document = {
            "name": name,
            "about": about,
            "seed": seed,
            "randomise": randomise,
            "replicates": replicates,
            "directions": list(directions),
            "reference_every": reference_every,
            "pass": {"settle_s": settle_s, "measure_s": measure_s},
            "base": {
                "amplitude_pp_m": amplitude_pp_m,
                "frequency_hz": frequency_hz,
                "speed_m_s": speed_m_s,
                "normal_force_n": normal_force_n,
                "position_m": position_m,
            },
            "series": lists,
            "protocol": dict(protocol or {}),
        }
        return _plan(_muprime.plan_made(json.dumps(document)))

    def passes(
        self, setup: str | os.PathLike[str] = "virtual-ideal", seed: int | None = None
    ) -> dict[str, NDArray[np.float64]]:
        """The passes on a setup (a file or a bundled name) in the order of measurement, a column each: ``amplitude_pp_m``, ``frequency_hz``,
        ``speed_m_s``, ``normal_force_n``, ``position_m``, ``direction``, ``replicate``, ``reference`` (1 for a pass that anchors mu_0), ``ambient_pressure_pa`` (NaN where the plan states none).

        Judged as ``muprime run`` would before it touches anything: limits, travel, what the instruments take and see. Nothing is opened.
        """
        points = json.loads(_muprime.plan_passes(self.name, self.toml, os.fspath(setup), seed))
        of: dict[str, Callable[[Any], Any]] = {
            "ambient_pressure_pa": lambda p: p["condition"]["ambient_pressure_pa"],
            "amplitude_pp_m": lambda p: p["condition"]["amplitude"],
            "frequency_hz": lambda p: p["condition"]["frequency_hz"],
            "speed_m_s": lambda p: p["condition"]["speed_m_s"],
            "normal_force_n": lambda p: p["condition"]["normal_force_n"],
            "position_m": lambda p: p["condition"]["position_m"],
            "direction": lambda p: p["condition"]["direction"],
            "replicate": lambda p: p["replicate"],
            "reference": lambda p: p["reference"],
        }
        return {name: np.array([get(p) for p in points], dtype=np.float64) for name, get in of.items()}

    def save(self, path: str | os.PathLike[str]) -> None:
        """Writes its text; a file that exists is refused."""
        with open(path, "x", encoding="utf-8") as out:
            out.write(self.toml)


def _plan(told: tuple[str, str, str]) -> Plan:
    name, toml, document = told
    return Plan(name, toml, json.loads(document))
