"""What the package costs beside the binary and beside NumPy, in one run, by turns.

    measure.py MUPRIME FOLDER [ROUNDS]

Prints medians; asserts only that both sides say the same.
"""

import os
import resource
import statistics
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas

import muprime

MUPRIME, FOLDER = sys.argv[1], Path(sys.argv[2])
ROUNDS = int(sys.argv[3]) if len(sys.argv) > 3 else 5


def timed(call):
    """Wall-clock and processor seconds of a call, children's included, and its answer."""
    before = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    began = time.perf_counter()
    answer = call()
    took = time.perf_counter() - began
    after = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    cpu = sum(b.ru_utime + b.ru_stime - a.ru_utime - a.ru_stime for a, b in zip(before, after))
    return took, cpu, answer


def beside(what, here, there, rounds=ROUNDS):
    """Both by turns; medians, and the median of the ratios of neighbours."""
    told = [(timed(here), timed(there)) for _ in range(rounds)]
    ratios = [statistics.median(a[k] / b[k] for a, b in told) for k in (0, 1)]
    seconds = [statistics.median(pair[side][0] for pair in told) for side in (0, 1)]
    print(f"{what}: {seconds[0]:.3f} s here, {seconds[1]:.3f} s there; ratio {ratios[0]:.2f} of wall-clock time, {ratios[1]:.2f} of processor time, {rounds} rounds")
    return told[-1][0][2], told[-1][1][2]


# Import, in interpreters of their own.
def started(words):
    return subprocess.run([sys.executable, "-c", words], check=True, env=os.environ)


beside("import muprime, beside import numpy alone", lambda: started("import muprime"), lambda: started("import numpy"), 9)

# A diagnosis of 500 passes, from pandas.
plan = muprime.Plan.make(
    "five-hundred", {"amplitude_pp_m": np.linspace(0.5e-6, 4e-6, 8), "speed_m_s": [0.01, 0.02, 0.04]}, replicates=9, reference_every=8
)
run = muprime.run(plan, out=FOLDER / "five-hundred", setup="virtual", seed=3)
table, rig = FOLDER / "five-hundred/points.csv", FOLDER / "five-hundred/rig.toml"
frame: pandas.DataFrame = pandas.read_csv(table)
words = [MUPRIME, "diagnose", str(table), "--json"]
mine, theirs = beside(
    f"diagnose of {len(frame)} passes from pandas, beside the command on the file",
    lambda: muprime.diagnose(frame, rig),
    lambda: subprocess.run(words, check=True, capture_output=True, text=True).stdout,
)
assert mine.text in theirs

# A million conditions of Eq. 20: the same checks, both readings, value, uncertainty and range.
million = np.random.default_rng(1).uniform(0.5e-6, 6e-6, 1_000_000)


def numpys(w, f=27.5e3, u=0.02, n=0.25, mu0=0.5, nu=0.33, star=2.38, sd=0.21, rmse=0.11):
    w, f, u, n, mu0 = np.broadcast_arrays(w, f, u, n, mu0)
    for column, least in ((w, 0.0), (u, 0.0), (f, 5e-324), (n, 5e-324), (mu0, 5e-324)):
        if not (np.isfinite(column) & (column >= least)).all():
            raise ValueError
    with np.errstate(divide="ignore", invalid="ignore"):
        group = u / (w * f * mu0 * (1 + nu))
        mean, square = np.zeros(w.shape), np.zeros(w.shape)
        for strokes in (1.0, 2.0):
            ratio = group / (star / strokes)
            mu = -np.expm1(-ratio)
            fit = np.where(np.isfinite(ratio), -ratio / (star / strokes) * np.exp(-ratio), 0.0) * (sd / strokes)
            spread = np.where(w == 0.0, 0.0, np.hypot(fit, rmse))
            mean += 0.5 * mu
            square += 0.5 * (mu * mu + spread * spread)
    ranges = ((w, 1e-6, 5e-6), (f, 10e3, 100e3), (u, 5e-3, 0.1), (mu0, 0.1, 2.0), (n, 0.1, 1.0))
    inside = np.logical_and.reduce([(v >= low * 0.999) & (v <= high * 1.001) for v, low, high in ranges])
    return mean, np.sqrt(np.maximum(square - mean * mean, 0.0)), inside | (w == 0.0)


law, (mean, sd, inside) = beside("psi on 10^6 conditions, beside NumPy doing the same", lambda: muprime.psi(million), lambda: numpys(million), 9)
assert np.allclose(law.mu_relative, mean, atol=1e-12) and np.allclose(law.mu_relative_sd, sd, atol=1e-9) and (law.inside == inside).all()
beside(
    "psi under one reading on 10^6 conditions, beside Eq. 20 alone in NumPy (no checks, no uncertainty)",
    lambda: muprime.psi(million, reading="peak-to-peak"),
    lambda: 1 - np.exp(-0.02 / (million * 27.5e3 * 0.5 * 1.33) / 2.38),
    9,
)
for name, law in (("spring-slider", muprime.spring_slider), ("surrogate", muprime.surrogate)):
    took = statistics.median(timed(lambda: law(million))[0] for _ in range(5))
    print(f"{name} on 10^6 conditions: {took:.3f} s")
w = np.geomspace(0.5e-6, 4e-6, 16)
together, alone = beside("16 cases of the ridge in one call, beside 16 calls", lambda: muprime.ridge(w, elements=200), lambda: [muprime.ridge(v, elements=200) for v in w], 3)
assert [one["mu_relative"] for one in alone] == together["mu_relative"].tolist()
