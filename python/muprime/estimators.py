"""Friction laws as estimators in the manner of scikit-learn: ``pip install "muprime[sklearn]"``.

The columns of ``X`` are, in this order, peak-to-peak amplitude in m, frequency in Hz, sliding speed in m/s, normal force in N, and the friction coefficient
without vibration; ``y`` is the relative friction mu' (Eq. 5). The laws themselves are those of the crates.

>>> from muprime.estimators import PsiRegressor
>>> import numpy as np
>>> w = np.linspace(1e-6, 5e-6, 9)
>>> X = np.column_stack([w, np.full(9, 27.5e3), np.full(9, 0.02), np.full(9, 0.25), np.full(9, 0.5)])
>>> y = 1 - np.exp(-0.02 / (w * 27.5e3 * 0.5 * 1.33) / 1.9)
>>> round(PsiRegressor().fit(X, y).psi_star_, 6)
1.9
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares  # type: ignore[import-untyped]
from sklearn.base import BaseEstimator, RegressorMixin  # type: ignore[import-untyped]
from sklearn.utils.validation import check_is_fitted, validate_data  # type: ignore[import-untyped]

from . import _muprime
from .laws import Finger, spring_slider

COLUMNS = ("amplitude_pp_m", "frequency_hz", "speed_m_s", "normal_force_n", "mu0")
"""What the columns of ``X`` are."""


class _Law(RegressorMixin, BaseEstimator):  # type: ignore[misc]
    """What both have in common: five columns, in SI units."""

    def _conditions(self, X: NDArray[np.float64]) -> NDArray[np.float64]:
        if X.shape[1] != len(COLUMNS):
            raise ValueError(f"X has {X.shape[1]} features; {len(COLUMNS)} are needed: {', '.join(COLUMNS)}")
        return X

    def _rows(self, X: Any, y: Any) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Of a fit."""
        X, y = validate_data(self, X, y, dtype=np.float64, y_numeric=True)
        return self._conditions(X), np.ascontiguousarray(y, dtype=np.float64)

    def _table(self, X: Any) -> NDArray[np.float64]:
        """Of a prediction."""
        check_is_fitted(self)
        table: Any = validate_data(self, X, reset=False, dtype=np.float64)
        return self._conditions(table)

    def __sklearn_tags__(self) -> Any:
        tags = super().__sklearn_tags__()
        tags.input_tags.positive_only = True
        # A law of physics has no room for whatever data come: it does not promise a score on random ones.
        tags.regressor_tags.poor_score = True
        return tags


class PsiRegressor(_Law):
    """Eq. 20, mu' = 1 - exp(-Psi/Psi*), with Psi* fitted by least squares (section 5.2 of Vezzoli et al.).

    ``fit`` takes ``groups``, a curve's number a row: points of one curve share their errors, so the uncertainty of Psi* comes from leaving
    out a curve at a time; without groups every row is a curve.
    """

    psi_star_: float
    """The fitted Psi* (Eq. 17's group)."""
    psi_star_sd_: float
    """Its standard uncertainty."""
    rmse_: float
    """Root mean square residual in mu'."""

    def __init__(self, poisson_ratio: float = 0.33) -> None:
        self.poisson_ratio = poisson_ratio

    def fit(self, X: Any, y: Any, groups: Any = None) -> PsiRegressor:
        """Fits Psi*. Rows without vibration say nothing of it."""
        X, y = self._rows(X, y)
        curves = np.arange(len(X)) if groups is None else np.unique(groups, return_inverse=True)[1]
        columns = [np.ascontiguousarray(column) for column in X.T]
        self.psi_star_, self.psi_star_sd_, self.rmse_ = _muprime.fit_psi(
            columns, y, curves.tolist(), self.poisson_ratio
        )
        return self

    def predict(self, X: Any) -> NDArray[np.float64]:
        """mu' at conditions."""
        X = self._table(X)
        out = np.empty(len(X))
        _muprime.psi_curve([np.ascontiguousarray(column) for column in X.T], self.poisson_ratio, self.psi_star_, out)
        return out


class SpringSliderRegressor(_Law):
    """The massless spring-slider (Eqs. 6-15) with both stiffnesses fitted by least squares, in their logarithms, from those given."""

    normal_stiffness_n_per_m_: float
    """Fitted normal stiffness in N/m."""
    lateral_stiffness_n_per_m_: float
    """Fitted lateral stiffness in N/m."""
    relative_covariance_: NDArray[np.float64]
    """Covariance of the logarithms of both; infinite where the rows say nothing of one."""

    def __init__(
        self,
        normal_stiffness_n_per_m: float = 3.9e6,
        lateral_stiffness_n_per_m: float = 1.5e6,
        poisson_ratio: float = 0.33,
    ) -> None:
        self.normal_stiffness_n_per_m = normal_stiffness_n_per_m
        self.lateral_stiffness_n_per_m = lateral_stiffness_n_per_m
        self.poisson_ratio = poisson_ratio

    def _mu(self, X: NDArray[np.float64], normal: float, lateral: float) -> NDArray[np.float64]:
        finger = Finger(
            normal_stiffness_n_per_m=normal, lateral_stiffness_n_per_m=lateral, poisson_ratio=self.poisson_ratio
        )
        return spring_slider(*X.T, finger=finger).mu_relative

    def fit(self, X: Any, y: Any) -> SpringSliderRegressor:
        """Fits both stiffnesses."""
        X, y = self._rows(X, y)
        start = np.log([self.normal_stiffness_n_per_m, self.lateral_stiffness_n_per_m])
        # Not beyond a factor of 1000: where the rows say nothing of a stiffness, it stays about where it began.
        found = least_squares(
            lambda logs: self._mu(X, *np.exp(logs)) - y, start, bounds=(start - 7.0, start + 7.0), diff_step=1e-5
        )
        self.normal_stiffness_n_per_m_, self.lateral_stiffness_n_per_m_ = (float(v) for v in np.exp(found.x))
        freedom = max(len(X) - 2, 1)
        information = found.jac.T @ found.jac
        told = np.linalg.cond(information) < 1e12
        variance = 2.0 * found.cost / freedom
        self.relative_covariance_ = variance * np.linalg.inv(information) if told else np.full((2, 2), np.inf)
        return self

    def predict(self, X: Any) -> NDArray[np.float64]:
        """mu' at conditions."""
        X = self._table(X)
        return self._mu(X, self.normal_stiffness_n_per_m_, self.lateral_stiffness_n_per_m_)
