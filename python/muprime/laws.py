"""Friction laws under ultrasonic vibration, on whole columns of conditions."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import _muprime


def models() -> dict[str, Any]:
    """What the answers come from: version of the ridge, hashes of the surrogate's table and of the library of effects, as ``muprime --version --json``
    says them under ``models``. Two results of the same hashes come from the same models.
    """
    told: dict[str, Any] = json.loads(_muprime.models_json())
    return told


@dataclass(frozen=True)
class Finger:
    """A fingertip as the laws see it. Defaults: Vezzoli et al., Figs. 13 and 14, Table 2 (moist)."""

    normal_stiffness_n_per_m: float = 3.9e6
    """Normal stiffness at ultrasonic frequencies in N/m."""
    lateral_stiffness_n_per_m: float = 1.5e6
    """Lateral stiffness at ultrasonic frequencies in N/m."""
    stiffness_relative_sd: float = 0.0
    """Relative standard uncertainty of both, independent."""
    poisson_ratio: float = 0.33
    """Poisson's ratio, -1 to 0.5."""
    young_modulus_pa: float = 28.3e6
    """Young's modulus of the stratum corneum in Pa (the surrogate asks for it)."""
    lateral_recovery_m_per_s: float | None = None
    """Speed of the skin's lateral recovery in m/s (section 5.3); none: infinitely fast."""


class Law(NamedTuple):
    """What a law says of conditions; every array has their common shape."""

    mu_relative: NDArray[np.float64]
    """Relative friction, mu / mu_0 (Eq. 5)."""
    mu_relative_sd: NDArray[np.float64]
    """Its standard uncertainty from the law and its parameters."""
    inside: NDArray[np.bool_]
    """Inside the range that the law was fitted on or derived for; outside it extrapolates."""


def _columns(given: tuple[ArrayLike, ...]) -> tuple[list[NDArray[np.float64]], tuple[int, ...]]:
    """Columns of one length, and their common shape."""
    arrays = np.broadcast_arrays(*(np.asarray(column, dtype=np.float64) for column in given))
    return [_flat(array) for array in arrays], arrays[0].shape


def _flat(array: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.ascontiguousarray(array).reshape(-1)


def _evaluate(name: str, finger: Finger | None, reading: str | None, columns: tuple[ArrayLike, ...]) -> Law:
    arrays = [np.asarray(column, dtype=np.float64) for column in columns]
    shape = np.broadcast_shapes(*(array.shape for array in arrays))
    # A number stays one number: only columns are laid out.
    flat = [array.reshape(-1) if array.size == 1 else _flat(np.broadcast_to(array, shape)) for array in arrays]
    size = int(np.prod(shape))
    out, inside = [np.empty(size), np.empty(size)], np.empty(size, dtype=np.uint8)
    f = finger or Finger()
    told = (
        f.normal_stiffness_n_per_m,
        f.lateral_stiffness_n_per_m,
        f.stiffness_relative_sd,
        f.poisson_ratio,
        f.young_modulus_pa,
        f.lateral_recovery_m_per_s,
    )
    if size:
        _muprime.evaluate(name, flat, told, reading, out, inside)
    return Law(out[0].reshape(shape), out[1].reshape(shape), inside.view(np.bool_).reshape(shape))


def spring_slider(
    amplitude_pp_m: ArrayLike = 2e-6,
    frequency_hz: ArrayLike = 27.5e3,
    speed_m_s: ArrayLike = 0.02,
    normal_force_n: ArrayLike = 0.25,
    mu0: ArrayLike = 0.5,
    *,
    finger: Finger | None = None,
) -> Law:
    """The massless spring-slider, Eqs. 6-15 and section 5.3 of Vezzoli et al.

    Arguments are numbers or arrays that broadcast: peak-to-peak amplitude in m, frequency in Hz, sliding speed in m/s, normal force in N,
    and friction coefficient without vibration. A condition outside the law's domain is refused with its row.
    """
    return _evaluate("spring-slider", finger, None, (amplitude_pp_m, frequency_hz, speed_m_s, normal_force_n, mu0))


def psi(
    amplitude_pp_m: ArrayLike = 2e-6,
    frequency_hz: ArrayLike = 27.5e3,
    speed_m_s: ArrayLike = 0.02,
    normal_force_n: ArrayLike = 0.25,
    mu0: ArrayLike = 0.5,
    *,
    finger: Finger | None = None,
    reading: str | None = None,
) -> Law:
    """The empirical law, Eqs. 17 and 20, with Psi* = 2.38 +- 0.21.

    The paper does not say surely whether its w is peak-to-peak or the sine's amplitude: without ``reading``
    (``'peak-to-peak'`` or ``'sine-amplitude'``) the answer is the mixture of both, with its uncertainty.
    Arguments as of :func:`spring_slider`.
    """
    return _evaluate("psi", finger, reading, (amplitude_pp_m, frequency_hz, speed_m_s, normal_force_n, mu0))


def surrogate(
    amplitude_pp_m: ArrayLike = 2e-6,
    frequency_hz: ArrayLike = 27.5e3,
    speed_m_s: ArrayLike = 0.02,
    normal_force_n: ArrayLike = 0.25,
    mu0: ArrayLike = 0.5,
    *,
    finger: Finger | None = None,
) -> Law:
    """The interpolated table of the finite element ridge (section 3). Arguments as of :func:`spring_slider`."""
    return _evaluate("surrogate", finger, None, (amplitude_pp_m, frequency_hz, speed_m_s, normal_force_n, mu0))


def ridge(
    amplitude_pp_m: ArrayLike = 2e-6,
    frequency_hz: ArrayLike = 27.5e3,
    speed_m_s: ArrayLike = 0.02,
    normal_force_n: ArrayLike = 0.25,
    mu0: ArrayLike = 0.5,
    *,
    young_modulus_pa: ArrayLike = 28.3e6,
    poisson_ratio: ArrayLike = 0.33,
    elements: int = 800,
) -> dict[str, Any]:
    """The finite element ridge (section 3), run to its steady state: about a second a case and core on 800 elements.

    Arguments as of :func:`spring_slider`, and Young's modulus of the stratum corneum in Pa and Poisson's ratio; they broadcast. Answers with the
    keys of ``muprime model ridge --json``: ``mu_relative``, ``contact_fraction``, ``phase_shift_deg`` and so on; each is a number where
    all arguments are numbers, otherwise an array of their common shape. All cores work, with the interpreter free.
    """
    given = (amplitude_pp_m, frequency_hz, speed_m_s, normal_force_n, mu0, young_modulus_pa, poisson_ratio)
    flat, shape = _columns(given)
    runs: list[dict[str, Any]] = json.loads(_muprime.ridge(flat, elements)) if flat[0].size else []
    if shape == ():
        return runs[0]
    return {key: np.array([run[key] for run in runs]).reshape(shape) for key in (runs[0] if runs else {})}
