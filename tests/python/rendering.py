"""Rendering beside scipy: transfer function, coherence, corner and the inverse of the law.

    rendering.py FOLDER

Renders noise and a grating on the virtual rig. From the record's own JSON, scipy.signal makes the transfer function by Welch's method,
scipy.optimize fits the corner and turns the spring-slider round. Ends with an error where fidelity.json says something else.
"""

import json
import sys
from pathlib import Path

import mcap.reader
import numpy as np
from scipy.optimize import brentq, curve_fit
from scipy.signal import csd

import muprime

FOLDER = Path(sys.argv[1]) / "rendering"
FOLDER.mkdir()
HEAD = """
name = "peer"
seed = 3
reference_every = 4
replicates = 2
[pass]
measure_m = "60mm"
[base]
amplitude_pp_m = "5.5um"
frequency_hz = "27.5kHz"
speed_m_s = "40mm/s"
normal_force_n = "250mN"
[[series]]
speed_m_s = ["40mm/s"]
[render]
mean = 0.7
depth = 0.15
"""


def rendered(name: str, target: str) -> tuple[muprime.Fidelity, list[dict], float, float]:
    """A run, the rows of its rendered cycles, the law's mu_0 and the period of the loop."""
    plan = FOLDER / f"{name}.toml"
    plan.write_text(HEAD + target)
    found = muprime.render(plan, out=FOLDER / name)
    rows, mu0 = [], None
    with open(FOLDER / name / "run-1.mcap", "rb") as stream:
        for _, _, message in mcap.reader.make_reader(stream).iter_messages(topics=["/cycle"]):
            row = json.loads(message.data)
            for command in row["inputs"]["commands"]:
                if isinstance(command, dict) and "mu0" in command:
                    mu0 = command["mu0"]["value"]
            row["mu0"] = mu0
            rows.append(row)
    period = np.median(np.diff([row["now"] for row in rows])) * 1e-9
    return found, [row for row in rows if row.get("rendered") and row["marker"]["phase"] == "measure" and row["usable"]], mu0, period


def passes(rows: list[dict]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Wanted and measured mu' of each pass."""
    found: dict[int, tuple[list[float], list[float]]] = {}
    for row in rows:
        forces = row["inputs"]["seen"]["forces"]
        measured = np.sign(row["velocity_m_s"]) * forces["lateral"]["Ok"]["value"] / (forces["normal"]["Ok"]["value"] * row["mu0"])
        wanted, seen = found.setdefault(row["marker"]["point"], ([], []))
        wanted.append(row["rendered"]["wanted"])
        seen.append(measured)
    return [(np.array(w), np.array(m)) for w, m in found.values()]


found, rows, mu0, period = rendered("noise", 'target = "noise"\nwaves_m = ["0.24mm", "20mm"]\n')
group = found.groups[0]
series = passes(rows)
assert len(series) == group.document["passes"], (len(series), group.document["passes"])
both = np.concatenate([m - w for w, m in series])
assert abs(np.sqrt(np.mean(both**2)) - group.rms) < 1e-9, (np.sqrt(np.mean(both**2)), group.rms)

# The segments' length from the distance of the lines; the delay in whole cycles from the shift.
hz = group.transfer["hz"]
length = round(1 / (np.diff(hz).min() * period))
late = max(0, round(float(np.mean(group.document["shift_m"])) / (group.speed_m_s * period)))
sums = np.zeros((3, length // 2 + 1), complex)
for wanted, measured in series:
    x, y = wanted[: len(wanted) - late], measured[late:]
    count = (len(x) - length) // (length // 2) + 1
    for i, (a, b) in enumerate([(x, x), (y, y), (x, y)]):
        frequencies, spectrum = csd(a, b, fs=1 / period, window="hann", nperseg=length, noverlap=length // 2, detrend="constant")
        sums[i] += count * spectrum
gain = np.abs(sums[2]) / sums[0].real
coherence = np.abs(sums[2]) ** 2 / (sums[0].real * sums[1].real)
at = [int(np.argmin(np.abs(frequencies - f))) for f in hz]
off = [float(np.abs(a[at] / b - 1).max()) for a, b in ((gain, group.transfer["gain"]), (coherence, group.transfer["coherence"]))]
assert len(hz) > 20 and max(off) < 1e-6, off
print(f"transfer function and coherence of {len(hz)} lines, segments of {length}: off by {off[0]:.1e} and {off[1]:.1e} at most")

# The corner: the same low pass, fitted by scipy.
corner = group.document["minus_3_db"]["hz"]
used = hz <= 1.6 * corner
sd = 2 * np.maximum(group.transfer["gain_sd"] / group.transfer["gain"], 1e-4) * group.transfer["gain"] ** -2.0
low_pass = lambda f, a, b, c: a * (1 + b * (f / corner) ** 2 + c * (f / corner) ** 4)
(a, b, c), _ = curve_fit(low_pass, hz[used], group.transfer["gain"][used] ** -2.0, p0=(1, 1, 0), sigma=sd[used])
own = brentq(lambda f: low_pass(f, 1, b, c) - 2, 1, 500)
assert abs(own / corner - 1) < 0.02, (own, corner)
print(f"-3 dB at {corner:.2f} Hz, scipy {own:.2f} Hz")

# The inverse: scipy turns the spring-slider round at the conditions of the loop, whose load is a mean over its window and not that of one cycle.
_, rows, mu0, _ = rendered("grating", 'target = "grating"\nperiod_m = "2mm"\n')
ratios = []
for row in rows[:: max(1, len(rows) // 300)]:
    seen = row["inputs"]["seen"]
    condition = dict(
        speed_m_s=abs(seen["stage"]["Ok"]["velocity_m_s"]),
        normal_force_n=seen["forces"]["normal"]["Ok"]["value"],
        frequency_hz=row["drive_hz"],
        mu0=row["mu0"],
    )
    given = row["rendered"]
    assert given["reach"] == "within", given
    law = lambda w: float(muprime.spring_slider(w, **condition).mu_relative)
    ratios.append(given["amplitude"] / brentq(lambda w: law(w) - given["wanted"], 1e-9, 8e-6, xtol=1e-15))
off = np.abs(np.array(ratios) - 1)
assert abs(np.median(ratios) - 1) < 2e-3 and off.max() < 0.03, (np.median(ratios), off.max())
print(f"inverse: {len(ratios)} amplitudes over scipy's: median {np.median(ratios):.5f}, off by {off.max():.4f} at most")
print("ok")
