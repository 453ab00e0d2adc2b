"""A law that is a Python function: tabulated, run, diagnosed, beside the command and beside polars.

    own_law.py MUPRIME FOLDER

Prints what was measured; ends with an error where something is not so.
"""

import json
import subprocess
import sys
from pathlib import Path

import muprime
import numpy as np
import polars

# Other scripts of this test make runs in the same folder.
MUPRIME, FOLDER = sys.argv[1], Path(sys.argv[2]) / "own-law"
FOLDER.mkdir()


def command(*words: str) -> str:
    return subprocess.run([MUPRIME, *words], check=True, capture_output=True, text=True, cwd=FOLDER).stdout


def refusal(call, *parts: str) -> None:
    try:
        call()
    except muprime.MuprimeError as why:
        assert all(part in str(why) for part in parts), f"{why} lacks one of {parts}"
    else:
        raise AssertionError(f"was not refused: {parts}")


calls = 0


def hyperbola(amplitude_pp_m, speed_m_s, mu0):
    """A law that is nobody's: it falls with w over the root of U."""
    global calls
    calls += 1
    return 1 / (1 + 0.9 * (amplitude_pp_m / 1e-6) ** 0.8 / np.sqrt(speed_m_s / 0.02) * (mu0 / 0.5) ** 0.3)


nodes = {
    "amplitude_pp_m": np.geomspace(0.2e-6, 6e-6, 25),
    "speed_m_s": np.geomspace(0.003, 0.12, 13),
    "mu0": np.linspace(0.2, 1.2, 6),
}
law = muprime.tabulate(hyperbola, nodes)
assert calls == 1 and law.checks == 528 and 1e-4 < law.error_greatest < 0.01, (calls, law.error_greatest)
assert "# origin: Python function __main__.hyperbola" in law.text and law.sha256 in law.text
path = law.save(FOLDER / "hyperbola.csv")
print(f"tabulated: greatest error {law.error_greatest:.1e} at {law.error_greatest_at}, rms {law.error_rms:.1e}")

# The loop reads what the function says, from Python and from the command, byte for byte.
run = muprime.run("first-sweep", out=FOLDER / "here", setup="virtual-ideal", seed=3, model=path)
command("run", "first-sweep", "--fast", "--setup", "virtual-ideal", "--seed", "3", "--model", "hyperbola.csv", "--out", "there")
assert (FOLDER / "here/points.csv").read_bytes() == (FOLDER / "there/points.csv").read_bytes()
assert run.facts["model"] == "hyperbola" and run.facts["model_sha256"] == law.sha256
passes = [json.loads(line) for line in (FOLDER / "here/passes.jsonl").read_text().splitlines()]
worst = 0.0
for one in passes:
    w, u = one["pass"]["amplitude"], one["pass"]["speed_m_s"]
    if w > 0:
        # mu_0 is the one found so far: within a tenth of the rig's 0.5 the law moves by less than 0.01.
        worst = max(worst, abs(one["comparison"]["predicted"] - hyperbola(w, u, 0.5)))
assert worst < 0.02, worst
print(f"run: {len(passes)} passes, predictions within {worst:.4f} of the function")

# The same table as Parquet is the same law, but for the digits that a float takes.
frame = polars.read_csv(path, comment_prefix="#")
frame.write_parquet(FOLDER / "zstd.parquet", compression="zstd")
refused = subprocess.run([MUPRIME, "check", "zstd.parquet"], capture_output=True, text=True, cwd=FOLDER)
assert refused.returncode == 2 and "with snappy, or as CSV" in refused.stderr, refused.stderr
frame.write_parquet(FOLDER / "columns.parquet", compression="snappy")
assert "OK: law table" in subprocess.run(
    [MUPRIME, "check", "columns.parquet"], check=True, capture_output=True, text=True, cwd=FOLDER
).stderr
command("run", "first-sweep", "--fast", "--setup", "virtual-ideal", "--seed", "3", "--model", "columns.parquet", "--out", "parquet")
again = [json.loads(line) for line in (FOLDER / "parquet/passes.jsonl").read_text().splitlines()]
assert [p["comparison"] for p in again] == [p["comparison"] for p in passes]

# A function is the base of a verdict; as a table and by its path it is the same one.
by_table = muprime.diagnose(run, model=law, pairs=False)
by_path = muprime.diagnose(run, model=path, pairs=False)
printed = command("--json", "diagnose", "here", "--model", "hyperbola.csv", "--no-pairs")
assert by_table.document == by_path.document == json.loads(printed)
assert by_table.document["law"] == {"name": "hyperbola", "sha256": law.sha256, "cannot_tell": []}
by_function = muprime.diagnose(run, model=hyperbola, pairs=False)
assert by_function.document["law"]["cannot_tell"] == [] and by_function.verdict == by_table.verdict
assert muprime.diagnose(run, pairs=False).verdict == "no_gap" != by_table.verdict
print(f"diagnosed: {by_table.text}")

refusal(lambda: muprime.tabulate(hyperbola, {**nodes, "speed_m_s": [0.003, 0.12]}), "fresh call", "more nodes")
refusal(lambda: muprime.tabulate(lambda speed_mm_s: speed_mm_s, {"speed_mm_s": [1, 2]}), "no variable 'speed_mm_s'")
refusal(lambda: muprime.tabulate(lambda mu0: mu0 * np.nan, {"mu0": [0.1, 1.0]}), "mu_relative is NaN at mu0")
refusal(lambda: muprime.diagnose(run, model=lambda colour: colour), "no variable 'colour'", "amplitude_pp_m")
print("ok")
