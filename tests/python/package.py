"""The installed package beside the binary and beside what nobody here wrote: NumPy, pandas, polars, pyarrow.

    package.py MUPRIME FOLDER

Prints what was measured; ends with an error where something is not so.
"""

import hashlib
import json
import math
import subprocess
import sys
import threading
import time
from pathlib import Path

import h5py
import mcap.reader
import numpy as np
import pandas
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

# Cycles as the record has them, and a tree that NetCDF holds: read back by another library.
tree = run.to_xarray()
assert tree["passes"]["lateral_force_n"].attrs["units"] == "N" and tree.attrs["operator"] == "A. Nother"
assert np.array_equal(tree["passes"]["lateral_force_n"].values, table["lateral_force_n"].to_numpy())
cycles = tree["cycles"].to_dataset()
told("export", str(FOLDER / "here"), "--to", "mcap")
with open(FOLDER / "here/signals.mcap", "rb") as stream:
    published = [m for _, c, m in mcap.reader.make_reader(stream).iter_messages(topics=["/force/lateral_force_n"])]
forces = cycles["lateral_force_n"].values
assert len(published) == np.count_nonzero(~np.isnan(forces)), (len(published), len(forces))
assert [json.loads(m.data)["value"] for m in published[:500]] == list(forces[~np.isnan(forces)][:500])
one = run.cycles(points=[2])
assert 0 < one.num_rows < len(forces) and set(one["point"].to_pylist()) == {2.0}
assert (cycles["point"] == 2).sum() == one.num_rows and "cycles" not in run.to_xarray(points=None)
tree.to_netcdf(FOLDER / "run.nc", engine="h5netcdf")
with h5py.File(FOLDER / "run.nc") as held_in:
    assert np.array_equal(held_in["cycles/lateral_force_n"][()], forces, equal_nan=True)
    assert held_in["passes/speed_m_s"].attrs["units"] == "m/s"
print(f"cycles: {len(forces)} of {len(cycles)} curves; NetCDF {(FOLDER / 'run.nc').stat().st_size / 1e6:.1f} MB")

# A grating, rendered: wanted, commanded, predicted and measured over position as arrays; a plan without a target is refused.
rendered = muprime.render(out=FOLDER / "grating")
assert [round(group.speed_m_s * 1e3) for group in rendered.groups] == [10, 20, 40]
for group in rendered.groups:
    forward = group.forward
    assert len(forward["x_m"]) > 100 and np.corrcoef(forward["wanted"], forward["predicted"])[0, 1] > 0.9
    assert group.rms_shifted < 0.06 and len(group.transfer["hz"]) > 0, group
refusal(lambda: muprime.render("first-sweep", out=FOLDER / "flat"), "rendered nothing")

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

# Several runs count as one table, byte for byte as the command has it.
other = muprime.run("first-sweep", out=FOLDER / "other", setup="virtual", seed=8)
joined = muprime.diagnose([run, other.folder], pairs=False)
assert joined.json + "\n" == told("diagnose", str(FOLDER / "here"), str(FOLDER / "other"), "--no-pairs", "--json")
refusal(lambda: muprime.diagnose([run, FOLDER / "there"]), "same passes")
(FOLDER / "other/rig.toml").write_text((FOLDER / "other/rig.toml").read_text().replace("pass_relative_sd = 0.", "pass_relative_sd = 0.1"))
refusal(lambda: muprime.diagnose([run, other]), "differ", "rig=")
refusal(lambda: muprime.diagnose([]), "empty")

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
print(f"10^6 conditions of the spring-slider: {slider:.3f} s, another thread took {ticks[0]} turns meanwhile")
assert ticks[0] > 5, "the interpreter was held"
one = muprime.ridge(elements=200)
many = muprime.ridge([[2e-6], [3e-6]], speed_m_s=[0.02, 0.04], elements=200)
assert many["mu_relative"].shape == (2, 2) and many["mu_relative"][0, 0] == one["mu_relative"] and many["regime"][0, 0] == one["regime"]
assert many["mu_relative"][1, 1] == muprime.ridge(3e-6, speed_m_s=0.04, elements=200)["mu_relative"]
refusal(lambda: muprime.ridge([2e-6, -1.0], elements=200), "row 1")
assert math.isclose(one["mu_relative"], json.loads(told("model", "ridge", "--json", "--elements", "200"))["mu_relative"])

# Which models these are, as the command says it.
version = json.loads(told("--version", "--json"))
assert version["models"] == muprime.models() and version["version"] == muprime.__version__
own = hashlib.sha256(Path(MUPRIME).read_bytes()).hexdigest()
assert version["build"]["program_sha256"] == own and own in told("--version") and told("-V") == f"muprime {muprime.__version__}\n"

# Plans: read, made, judged on a setup, run; a made one is what the command runs from its file.
bundled = muprime.Plan.load("first-sweep")
assert bundled.toml == told("show", "first-sweep") and len(bundled.passes("virtual")["speed_m_s"]) == 98
made = muprime.Plan.make("mine", {"amplitude_pp_m": [1e-6, 3e-6], "speed_m_s": [0.01, 0.03]}, replicates=2, reference_every=4, seed=5)
made.save(FOLDER / "mine.toml")
checked = json.loads(told("check", "--json", "--offline", str(FOLDER / "mine.toml"), "--setup", "virtual-ideal"))
order = made.passes("virtual-ideal")
assert checked["ok"] and checked["passes"] == len(order["amplitude_pp_m"]) == 16 + 3 * 2, checked
mine = muprime.run(made, out=FOLDER / "mine", seed=5)
told("run", str(FOLDER / "mine.toml"), "--fast", "--setup", "virtual-ideal", "--seed", "5", "--out", str(FOLDER / "theirs"))
assert (FOLDER / "mine/points.csv").read_bytes() == (FOLDER / "theirs/points.csv").read_bytes()
assert np.allclose(mine.pandas()["amplitude_pp_m"], order["amplitude_pp_m"], atol=1e-9) and np.array_equal(mine.pandas()["direction"], order["direction"])
assert muprime.Plan.load(FOLDER / "mine.toml").document == made.document == muprime.Plan.parse(made.toml).document
refusal(lambda: muprime.Plan.make("none"), "[[series]]")
refusal(lambda: muprime.Plan.make("empty", {"amplitude_pp_m": [], "speed_m_s": [0.01, 0.05]}), "amplitude_pp_m lists no value")
assert muprime.Plan.make("units", {"amplitude_pp_m": ["2um"]}).document["series"][0]["amplitude_pp_m"] == [2e-6]
refusal(lambda: mine.cycles(points=[2, 999]), "no cycles of point 999")
refusal(lambda: muprime.Plan.make("typo", {"amplitude_m": [1e-6]}), "amplitude_m")
refusal(lambda: muprime.Plan.make("far", {"amplitude_pp_m": [1e-3]}).passes(), "amplitude_pp_m = 1 mm", "outside")
refusal(lambda: muprime.Plan.load("no-such-plan"), "bundled plans")

# Certificates: the same parameters as the command's from the same files; the date and so the hash are each one's own.
turn = np.linspace(0.0, 1.0, 41)
rows = [f"{x:.6e},{0.2 + 1200 * x + up * 0.01:.6e},{up}" for up, way in ((1, turn), (0, turn[::-1])) for x in way * 2e-4]
(FOLDER / "loop.csv").write_text("displacement_m,force_n,up\n" + "\n".join(rows) + "\n")
words = {"operator": "A. Nother", "serial": "tip 7", "date": "2026-03-01T12:00:00Z"}
certificate = muprime.calibrate("finger", normal_loop=FOLDER / "loop.csv", about_m=1e-4, valid_days=400, **words)
flags = [f"--{key}={value}" for key, value in words.items()]
out = FOLDER / "tip.toml"
said = json.loads(told("calibrate", "finger", "--json", "--normal-loop", str(FOLDER / "loop.csv"), "--about-m=1e-4", "--valid-days=400", f"--out={out}", *flags))
assert certificate.toml == out.read_text() and certificate.content_sha256 == said["content_sha256"]
assert [p.name for p in certificate.parameters] == [p["name"] for p in said["parameters"]]
stiffness = certificate.parameters[0]
assert abs(stiffness.value / 1200 - 1) < 0.02 and stiffness.unit == "N/m" and certificate[stiffness.name] is stiffness, certificate
assert muprime.load_certificate(out) == certificate
refusal(lambda: muprime.load_certificate(FOLDER / "mine.toml"), "mine.toml")
(FOLDER / "forged.toml").write_text(certificate.toml.replace("tip 7", "tip 8"))
refusal(lambda: muprime.load_certificate(FOLDER / "forged.toml"), "forged.toml")
refusal(lambda: muprime.calibrate("finger", operator="x", serial="y"), "nothing to calibrate")
refusal(lambda: muprime.calibrate("force", operator="x", serial="y"), "from files alone")
refusal(lambda: muprime.calibrate("finger", operator="x", serial="y", no_such=1), "--no-such")

# The skin of a finger: the ridge's own phases give back the modulus that made them, from a frame as from the command's file.
# On 128 elements, with two or three nodes in contact, phases jump with the modulus by more than the fit allows for.
w = np.array([0.6e-6, 1e-6, 1.5e-6, 2e-6, 2.6e-6])
phases = muprime.ridge(w, young_modulus_pa=40e6, elements=300)["phase_shift_deg"]
frame = pandas.DataFrame({"amplitude_pp_m": w, "phase_shift_deg": phases, "phase_shift_sd_deg": 5.0})
frame.to_csv(FOLDER / "phases.csv", index=False)
search = {"elements": 300, "modulus_only": True, "modulus_range_pa": (15e6, 120e6)}
skin = muprime.fit_finger(frame, **search)
print(f"modulus from phases made with 40 MPa: {skin.young_modulus_pa.value / 1e6:.1f} MPa {skin.young_modulus_pa.ci95}, residual {skin.residual_rms_deg:.1f} deg")
assert skin.young_modulus_pa.ci95[0] < 40e6 < skin.young_modulus_pa.ci95[1] and abs(skin.young_modulus_pa.value / 40e6 - 1) < 0.2
assert skin.penalty_ratio is None and muprime.fit_finger(frame[::-1], **search).young_modulus_pa == skin.young_modulus_pa
same = muprime.calibrate("finger", FOLDER / "phases.csv", **words, **search)
assert same.skin == skin.document and any(p.name.endswith("modulus") or "modulus" in p.name for p in same.parameters)
refusal(lambda: muprime.fit_finger(frame.assign(phase_shift_deg=400.0)), "line 2", "400")

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
