"""The installed package beside the binary and beside what nobody here wrote: NumPy, pandas, polars, pyarrow.

    package.py MUPRIME FOLDER

Prints what was measured; ends with an error where something is not so.
"""

import json
import math
import subprocess
import sys
import threading
import time
from pathlib import Path

import numpy as np
import polars
import pyarrow.csv

BEGAN = time.perf_counter()
import muprime  # noqa: E402

print(f"import: {1e3 * (time.perf_counter() - BEGAN):.0f} ms (NumPy already there), version {muprime.__version__}")
MUPRIME, FOLDER = sys.argv[1], Path(sys.argv[2])


def told(*words: str) -> str:
    return subprocess.run([MUPRIME, *words], check=True, capture_output=True, text=True).stdout


def refusal(call, *parts: str) -> None:
    try:
        call()
    except muprime.MuprimeError as why:
        assert all(part in str(why) for part in parts), f"{why} lacks one of {parts}"
    else:
        raise AssertionError(f"was not refused: {parts}")


# A sweep from here is the command's, byte for byte.
run = muprime.run("first-sweep", out=FOLDER / "here", setup="virtual", seed=7, operator="A. Nother", sample="silicone")
told("run", "first-sweep", "--fast", "--setup", "virtual", "--seed", "7", "--out", str(FOLDER / "there"))
assert (FOLDER / "here/points.csv").read_bytes() == (FOLDER / "there/points.csv").read_bytes()
assert run.summary is not None and run.summary["outcome"] == "complete" and run.facts["operator"] == "A. Nother" and not run.damage

# Loaded without copies, equal to the table, with units.
table = run.arrow()
points = pyarrow.csv.read_csv(FOLDER / "here/points.csv")
for name in ("amplitude_pp_m", "speed_m_s", "normal_force_n", "lateral_force_n"):
    assert np.array_equal(table[name].to_numpy(), points[name].to_numpy()), name
first = table["lateral_force_n"].chunk(0).buffers()[1].address
held = pyarrow.py_buffer(run._arrow)
assert held.address <= first < held.address + held.size, "the column was copied"
assert run.units()["lateral_force_n"] == "N" and run.polars().height == run.pandas().shape[0] == table.num_rows == 98

# The verdict is the command's, byte for byte: of a run, of a path, and of frames whose text is the table's.
began = time.perf_counter()
verdict = muprime.diagnose(run)
here = time.perf_counter() - began
began = time.perf_counter()
said = told("diagnose", str(FOLDER / "here"), "--json")
there = time.perf_counter() - began
assert verdict.json + "\n" == said
print(f"diagnose of {table.num_rows} passes: {here:.2f} s here, {there:.2f} s by the command")
assert verdict.verdict == "named" and verdict.hypotheses[0].effects == ("squeeze_film",), verdict.text
assert verdict.hypotheses[0].parameters[0].ci95 is not None and verdict.shrinkage is not None and verdict.shrinkage > 0.8
assert "<iframe" in verdict._repr_html_() and str(verdict).startswith(verdict.text)
rig = FOLDER / "here/rig.toml"
columns = points.column_names
for frame in (points, points.to_pandas(), polars.from_arrow(points)):
    again = muprime.diagnose(frame, rig, predict=points.select([c for c in columns if not c.startswith("lateral_force")]).slice(0, 5))
    assert again.text == verdict.text and [h.probability for h in again.hypotheses] == [h.probability for h in verdict.hypotheses]
    assert again.predictions is not None and again.predictions.count("\n") == 6

# Laws: against the command, against Eq. 20 in NumPy, and on a million conditions beside it.
w = np.geomspace(0.3e-6, 5e-6, 7)
for name, law in (("spring-slider", muprime.spring_slider), ("psi", muprime.psi), ("surrogate", muprime.surrogate)):
    found = law(w, frequency_hz=40e3, speed_m_s=0.03)
    for i, amplitude in enumerate(w):
        said = json.loads(told("model", "point", "--json", "--model", name, "--amplitude-pp-m", repr(float(amplitude)), "--frequency-hz", "40e3", "--speed-m-s", "0.03"))
        assert said["mu_relative"] == found.mu_relative[i] and said["mu_relative_sd"] == found.mu_relative_sd[i], (name, amplitude)
grid = muprime.psi(w[:, None], speed_m_s=np.array([0.01, 0.05]), reading="sine-amplitude")
numpys = 1 - np.exp(-np.array([0.01, 0.05]) / (w[:, None] * 27.5e3 * 0.5 * 1.33) / 1.19)
assert grid.mu_relative.shape == (7, 2) and np.allclose(grid.mu_relative, numpys, rtol=0, atol=1e-12)
both = [muprime.psi(w, reading=r).mu_relative for r in ("peak-to-peak", "sine-amplitude")]
assert np.allclose(muprime.psi(w).mu_relative, np.mean(both, axis=0))
million = np.random.default_rng(1).uniform(0.5e-6, 5e-6, 1_000_000)
began = time.perf_counter()
muprime.psi(million, reading="peak-to-peak")
here = time.perf_counter() - began
began = time.perf_counter()
1 - np.exp(-0.02 / (million * 27.5e3 * 0.5 * 1.33) / 2.38)
there = time.perf_counter() - began
ticks, over = [0], threading.Event()


def count() -> None:
    while not over.is_set():
        ticks[0] += 1
        time.sleep(0.001)


thread = threading.Thread(target=count)
thread.start()
began = time.perf_counter()
muprime.spring_slider(million)
slider = time.perf_counter() - began
over.set()
thread.join()
print(f"10^6 conditions: psi {here:.3f} s with its uncertainty and checks, NumPy's Eq. 20 alone {there:.3f} s (ratio {here / there:.1f}); spring-slider {slider:.3f} s, another thread took {ticks[0]} turns meanwhile")
assert ticks[0] > 5, "the interpreter was held"
one = muprime.ridge(elements=200)
assert math.isclose(one["mu_relative"], json.loads(told("model", "ridge", "--json", "--elements", "200"))["mu_relative"])

# Refusals say where and what to do.
refusal(lambda: muprime.spring_slider([2e-6, -1e-6]), "row 1", "amplitude")
refusal(lambda: muprime.spring_slider([2e-6, float("nan")]), "row 1")
refusal(lambda: muprime.psi(reading="rms"), "peak-to-peak")
refusal(lambda: muprime.load(FOLDER), "holds no run")
refusal(lambda: muprime.diagnose(points.to_pandas()), "rig=")
refusal(lambda: muprime.diagnose(points.to_pandas().assign(normal_force_n=-1.0), rig), "normal_force_n")
refusal(lambda: muprime.diagnose(run, without=["gravity"]), "gravity")
refusal(lambda: muprime.run("no-such-plan", out=FOLDER / "x"), "no-such-plan")
assert muprime.spring_slider([]).mu_relative.size == 0
print("ok")
