#!/usr/bin/env python3
"""A peer for `muprime diagnose`: least squares (lmfit) of each effect alone, ranked by BIC.

usage: lmfit_bic.py FOLDER   with FOLDER/open/*/{points.csv,rig.toml} and FOLDER/sealed/*/label.toml
(`muprime blind --write FOLDER` makes them). Prints one line a set and the share named right.
One form an effect, several starts, weights from rig.toml; no open set and no form uncertainty.
"""
import csv
import math
import pathlib
import sys
import tomllib

import lmfit
import numpy as np

GRID = np.linspace(-np.pi, np.pi, 257)


def slider(mu, kn, kl, w, f, U, F, pull=0.0):
    """Mean friction of the massless slider by the running minimum over one cycle."""
    a = np.maximum(w / 2, 1e-12)
    lo, hi = -a - 1e-9, F / kn + a
    z = a[:, None] * np.cos(GRID[:-1])[None, :]
    for _ in range(45):
        mid = (lo + hi) / 2
        q = kn[:, None] * (z + mid[:, None])
        up = np.where(q > -pull, q, 0).mean(1) > F
        hi, lo = np.where(up, mid, hi), np.where(up, lo, mid)
    q = kn[:, None] * (a[:, None] * np.cos(GRID)[None, :] + lo[:, None])
    touch = q > -pull
    limit = mu[:, None] * np.where(touch, q + pull, 0)
    drag = (kl * U / (2 * np.pi * f))[:, None] * (GRID + np.pi)[None, :]
    force = np.minimum(np.minimum.accumulate(limit - drag, axis=1) + drag, limit)
    return np.where(w < 1e-12, mu * (F + pull), force[:, :-1].mean(1))


def shaped(d, p, name):
    w, f, U, F = d["w"], d["f"], d["U"], d["F"]
    n = len(w)
    mu, kn, kl = (np.full(n, p[k]) for k in ("mu0", "kn", "kl"))
    s, q = p.get("size", 0.0), p.get("shape", 0.5)
    t = d["t"] / max(d["t"].max(), 1e-9)
    gain, add, solid, pull = 1.0, 0.0, 1.0, 0.0
    if name == "squeeze_film":
        solid = 1 / (1 + abs(s) * (w / 2e-6) ** 2 * d["p"])
    elif name == "load_dependent_friction":
        mu = mu * (F / 0.3) ** s
    elif name == "rate_dependent_friction":
        mu = mu * (U / 0.02) ** s
    elif name == "adhesion":
        pull = abs(s) * 0.1
    elif name == "moisture_drift":
        mu = mu * np.maximum(1 + s * (1 - np.exp(-t / max(abs(q), 0.02))), 0.05)
    elif name == "subsurface_relaxation":
        k = np.maximum(1 + s * (1 - np.exp(-t / max(abs(q) * 0.1, 0.002))), 0.05)
        kn = kn * k
    elif name == "contact_ageing":
        phi = np.minimum((3 * np.pi * np.minimum(F / (kn * np.maximum(w / 2, 1e-12)), 1)) ** (1 / 3), np.pi)
        tc = phi / (np.pi * f)
        mu = np.where(w > 0, mu * tc / (tc + abs(s) * 1e-5), mu)
    elif name == "stiffness_error":
        kl = kl * math.exp(s)
    elif name == "amplitude_miscalibration":
        w = w * math.exp(s)
    elif name == "amplitude_droop":
        w = w / (1 + abs(s) * F)
    elif name == "amplitude_saturation":
        w = w / (1 + (abs(s) * w / w.max()) ** 4) ** 0.25
    elif name == "resonance_detuning":
        w = w / np.sqrt(1 + (s * (1 - np.exp(-t / max(abs(q), 0.02)))) ** 2)
    elif name == "mode_shape":
        w = w * np.sqrt(np.maximum(1 - abs(s) * np.sin(np.pi * d["x"] / (0.004 + 0.02 * abs(q))) ** 2, 1e-3))
    elif name == "speed_ripple":
        U = U * np.maximum(1 + s * np.sin(2 * np.pi * d["x"] / (0.001 + 0.01 * abs(q))), 0.05)
    elif name == "speed_error":
        U = U * math.exp(s)
    elif name == "normal_offset":
        F = np.maximum(F - 0.1 * s, 1e-3)
    elif name == "force_crosstalk":
        add = 0.1 * s * F
    elif name == "plate_tilt":
        add = np.sin(0.1 * s) * F
        gain = np.cos(0.1 * s)
    elif name == "lateral_offset_drift":
        add = 0.02 * s * (q + (1 - q) * t)
    return gain * d["dir"] * slider(mu, kn, kl, w, f, U, F * solid, pull) + add


EFFECTS = (
    "squeeze_film load_dependent_friction rate_dependent_friction adhesion moisture_drift subsurface_relaxation "
    "contact_ageing stiffness_error amplitude_miscalibration amplitude_droop amplitude_saturation "
    "resonance_detuning mode_shape speed_ripple speed_error normal_offset force_crosstalk plate_tilt "
    "lateral_offset_drift"
).split()


def read(folder):
    rows = list(csv.DictReader(open(folder / "points.csv")))
    rows = [r for r in rows if r["lateral_force_n"]]
    get = lambda k, alt=0.0: np.array([float(r.get(k) or alt) for r in rows])
    d = dict(w=get("amplitude_pp_m"), f=get("frequency_hz"), U=get("speed_m_s"), F=get("normal_force_n"),
             dir=get("direction"), t=get("time_s"), x=get("position_m"), p=get("ambient_pressure_pa", 101325) / 101325)
    d["t"] = d["t"] - d["t"].min()
    return d, get("lateral_force_n"), tomllib.load(open(folder / "rig.toml", "rb"))


def diagnose(folder):
    d, y, rig = read(folder)
    still = d["w"] == 0
    mu0 = (d["dir"] * y * d["F"])[still].sum() / (d["F"][still] ** 2).sum() if still.any() else 0.5
    finger, noise = rig["finger"], rig["noise"]
    sd = np.sqrt((noise["pass_relative_sd"] * y) ** 2 + noise["force_sd_n"] ** 2 * (1 + mu0**2))
    ksd = finger["stiffness_relative_sd"]

    def fit(name, starts):
        best = None
        for size, shape in starts:
            p = lmfit.Parameters()
            p.add("mu0", mu0, min=0.02, max=5)
            for key, label in (("kn", "normal"), ("kl", "lateral")):
                k = finger[f"{label}_stiffness_n_per_m"]
                p.add(key, k, min=k * 0.3, max=k * 3)
            if name:
                p.add("size", size, min=-12, max=12)
                p.add("shape", shape, min=0.01, max=2)

            def residual(p):
                v = p.valuesdict()
                prior = [math.log(v["kn"] / finger["normal_stiffness_n_per_m"]) / ksd,
                         math.log(v["kl"] / finger["lateral_stiffness_n_per_m"]) / ksd]
                return np.concatenate([(y - shaped(d, v, name)) / sd, prior])

            out = lmfit.minimize(residual, p, max_nfev=60)
            if best is None or out.bic < best.bic:
                best = out
        return best.bic

    scores = {"none": fit(None, [(0, 0)])}
    for name in EFFECTS:
        scores[name] = fit(name, [(0.2, 0.3), (-0.5, 0.8)])
    return min(scores, key=scores.get)


def main():
    root = pathlib.Path(sys.argv[1])
    right = total = 0
    for folder in sorted((root / "open").iterdir()):
        label = tomllib.load(open(root / "sealed" / folder.name / "label.toml", "rb"))
        truth = "+".join(sorted(c["name"] for c in label.get("causes", []))) or "none"
        answer = diagnose(folder)
        counted = truth == "none" or label["chi2_gain"] >= 30
        right += counted and answer == truth
        total += counted
        print(f"{folder.name} {truth:28} chi2 {label['chi2_gain']:8.0f} -> {answer}", flush=True)
    print(f"right {right} of {total} (no gap, or detectable)")


if __name__ == "__main__":
    main()
