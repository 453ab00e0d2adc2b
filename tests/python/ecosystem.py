"""The package beside bluesky's own RunEngine and scikit-learn's own checks.

    ecosystem.py FOLDER

MUPRIME_BINARY names the binary. Ends with an error where something is not so.
"""

import json
import os
import sys
import threading
import time
from pathlib import Path
from unittest import SkipTest

import event_model
import numpy as np
from bluesky import RunEngine
from bluesky.utils import FailedStatus, RunEngineInterrupted
from scipy.optimize import curve_fit
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer
from sklearn.utils.estimator_checks import estimator_checks_generator

import muprime
from muprime.bluesky import COLUMNS, Sweep, SweepError, fly_sweep
from muprime.estimators import PsiRegressor, SpringSliderRegressor

FOLDER = Path(sys.argv[1])

# bluesky: documents of a sweep, valid by bluesky's own schemas, an event a pass, equal to the point table, with units.
engine, documents = RunEngine(), []
sweep = Sweep("first-sweep", out=FOLDER / "flown", seed=7, fast=True, name="sweep")
engine(fly_sweep(sweep, md={"sample": "silicone"}), lambda name, document: documents.append((name, document)))
for name, document in documents:
    event_model.schema_validators[event_model.DocumentNames[name]].validate(document)
start, descriptor, stop = (next(d for n, d in documents if n == name) for name in ("start", "descriptor", "stop"))
assert start["sample"] == "silicone" and stop["exit_status"] == "success" and stop["num_events"] == {"passes": 98}
keys = descriptor["data_keys"]
assert keys["sweep-normal_force_n"]["units"] == "N" and keys["sweep-amplitude_pp_m"]["units"] == "m" and len(keys) == len(COLUMNS)
assert descriptor["configuration"]["sweep"]["data"]["sweep-plan"] == "first-sweep"
points = muprime.load(FOLDER / "flown").arrow()
pages = [d for n, d in documents if n == "event_page"]
for column in ("amplitude_pp_m", "frequency_hz", "normal_force_n", "lateral_force_n", "time_s"):
    heard = np.concatenate([page["data"][f"sweep-{column}"] for page in pages])
    assert np.array_equal(heard, points[column].to_numpy()), column
assert sweep.summary is not None and sweep.summary["outcome"] == "complete"

# What is refused fails at the kickoff, with the remedy, and makes no folder.
try:
    engine(fly_sweep(Sweep("no-such-plan", out=FOLDER / "refused")))
except FailedStatus as why:
    assert isinstance(why.__cause__, SweepError) and "bundled plans" in str(why.__cause__), why.__cause__
else:
    raise AssertionError("a plan that does not exist was flown")
assert not (FOLDER / "refused").exists()

# In wall-clock time: events come while the sweep goes on, and an engine that is interrupted leaves a rig that was read back off.
live, heard = Sweep("first-sweep", out=FOLDER / "live", name="live"), []


def interrupt() -> None:
    deadline = time.monotonic() + 60
    while not any(name == "event_page" for name, _ in heard) and time.monotonic() < deadline:
        time.sleep(0.05)
    engine.request_pause()


thread = threading.Thread(target=interrupt)
thread.start()
try:
    engine(fly_sweep(live), lambda name, document: heard.append((name, document)))
except RunEngineInterrupted:
    pass
else:
    raise AssertionError("the engine was not interrupted")
thread.join()
assert any(name == "event_page" for name, _ in heard), "no event came while the sweep went on"
assert engine.state == "idle" and heard[-1][0] == "stop" and heard[-1][1]["exit_status"] != "success", heard[-1]
assert live.summary is not None and live.summary["outcome"] != "complete" and live.summary["off"]["read_back"], live.summary
assert json.loads((FOLDER / "live/summary.json").read_text())["outcome"] == live.summary["outcome"]

# Estimators: Psi* and its curve as SciPy's curve_fit finds them; the stiffnesses that made the data.
rng = np.random.default_rng(3)
n = 200
X = np.column_stack([
    rng.uniform(1e-6, 5e-6, n), rng.uniform(10e3, 100e3, n), rng.uniform(5e-3, 0.1, n), rng.uniform(0.1, 1.0, n), rng.uniform(0.2, 2.0, n)
])
psi = X[:, 2] / (X[:, 0] * X[:, 1] * X[:, 4] * 1.33)
y = 1 - np.exp(-psi / 2.0) + rng.normal(0, 0.01, n)
mine = PsiRegressor().fit(X, y)
(star,), ((variance,),) = curve_fit(lambda x, s: 1 - np.exp(-x / s), psi, y, p0=[1.0])
assert abs(mine.psi_star_ / star - 1) < 1e-6 and abs(mine.psi_star_sd_ / np.sqrt(variance) - 1) < 0.5, (mine.psi_star_, star, mine.psi_star_sd_, variance)
assert np.allclose(mine.predict(X), 1 - np.exp(-psi / star), atol=1e-8) and mine.score(X, y) > 0.95
assert np.allclose(PsiRegressor().fit(X, y, groups=np.repeat(np.arange(20), 10)).psi_star_, mine.psi_star_)
truth = muprime.Finger(normal_stiffness_n_per_m=2.5e6, lateral_stiffness_n_per_m=0.8e6)
slid = muprime.spring_slider(*X.T, finger=truth).mu_relative
spring = SpringSliderRegressor().fit(X, slid)
assert abs(spring.normal_stiffness_n_per_m_ / 2.5e6 - 1) < 1e-3 and abs(spring.lateral_stiffness_n_per_m_ / 0.8e6 - 1) < 1e-3, vars(spring)
assert np.allclose(spring.predict(X), slid, atol=1e-4)
# In scikit-learn's own company.
assert cross_val_score(PsiRegressor(), X, y, cv=4).min() > 0.9
search = GridSearchCV(PsiRegressor(), {"poisson_ratio": [0.3, 0.45]}, cv=3).fit(X, y)
assert search.best_params_["poisson_ratio"] in (0.3, 0.45) and clone(mine).get_params() == mine.get_params()
assert make_pipeline(FunctionTransformer(np.abs), PsiRegressor()).fit(X, y).predict(X).shape == (n,)

# scikit-learn's checks of an estimator. They feed any number of random columns; a law of physics has five, all positive, and refuses others by name. So each law is
# checked behind a door that makes conditions of any columns and friction of any y; what it does with parameters, clones, pickles, dtypes, orders and bad input is its own.
LOW, HIGH = np.array([1e-6, 10e3, 5e-3, 0.1, 0.2]), np.array([5e-6, 100e3, 0.1, 1.0, 2.0])


class Door:
    def _conditions(self, X):
        return LOW + (0.5 + np.arctan(X[:, np.arange(5) % X.shape[1]]) / np.pi) * (HIGH - LOW)

    def _rows(self, X, y):
        X, y = super()._rows(X, y)
        return X, 0.5 + 0.9 * np.arctan(y) / np.pi

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.positive_only = False
        return tags


class AnyPsi(Door, PsiRegressor):
    pass


class AnySlider(Door, SpringSliderRegressor):
    pass


for estimator in (AnyPsi(), AnySlider()):
    passed, skipped = 0, []
    for one, check in estimator_checks_generator(estimator):
        try:
            check(one)
            passed += 1
        except SkipTest as why:
            skipped.append(f"{check.func.__name__} ({why})")
    print(f"scikit-learn's checks of {type(estimator).__name__}: {passed} pass; skipped by themselves: {', '.join(skipped)}")
    assert passed >= 45 and len(skipped) <= 2
for wrong, part in ((X[:, :4], "5 are needed"), (-X, "amplitude_pp_m"), (np.zeros((4, 5)), "frequency_hz")):
    try:
        PsiRegressor().fit(wrong, y[: len(wrong)])
    except ValueError as why:
        assert part in str(why), why
    else:
        raise AssertionError(part)
print("ok")
