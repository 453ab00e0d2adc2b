#!/usr/bin/env python3
"""A peer for `muprime diagnose` that learns: a random forest and gradient boosting (scikit-learn) on sealed sets.

usage: forest.py SEALED SETS [even|odd]
  SEALED/open/*/{points.csv,rig.toml} and SEALED/sealed/*/label.toml, as
    cargo run --release -p muprime-tests --example seal -- SEALED 1500 7100000
  writes them, are what it learns from;
  SETS/*/{train.csv,rig.toml,truth.json} of another generator are what it is tried on, those with such a number.

It needs scikit-learn 1.9, SciPy and numpy in a venv of its own; tests/requirements.txt does not ask for them.
What it is given of a table is what a tribologist would compute: the residuals about a recalibrated massless slider, regressed
on the conditions, their squares and first products and on what the slider says of an error in each condition; friction of
the plate at rest by load, speed, time and direction; the strongest period along the path. All in standard deviations.
"""
import collections
import csv
import json
import pathlib
import sys
import tomllib

import numpy as np
from joblib import Parallel, delayed
from scipy.optimize import least_squares
from sklearn.ensemble import HistGradientBoostingClassifier, RandomForestClassifier
from sklearn.model_selection import StratifiedKFold, cross_val_predict

CYCLE = np.linspace(-np.pi, np.pi, 181)
HALF = np.linspace(1e-4, np.pi, 4000)
PRESS = (np.sin(HALF) - HALF * np.cos(HALF)) / np.pi  # mean of max(cos - cos(half), 0)
CERTAIN = 0.9
FAINT = 30.0


def slider(mu, kn, kl, w, f, speed, load):
    """Mean friction of the massless slider: pressed by a sinusoid, dragged at a steady speed, held by Coulomb's law."""
    a = np.maximum(w / 2, 1e-12)
    want = load / (kn * a)
    half = np.interp(want, PRESS, HALF)
    depth = np.where(want >= 1.0, want, -np.cos(half))
    limit = mu * kn * a[:, None] * np.maximum(np.cos(CYCLE)[None, :] + depth[:, None], 0)
    drag = (kl * speed / (2 * np.pi * f))[:, None] * (CYCLE + np.pi)[None, :]
    force = np.minimum(np.minimum.accumulate(limit - drag, axis=1) + drag, limit)
    return np.where(w < 1e-12, mu * load, force[:, :-1].mean(1))


def read(table, rig):
    rows = [r for r in csv.DictReader(open(table)) if r["lateral_force_n"]]

    def column(key, other):
        return np.array([float(r.get(key) or other) for r in rows])

    d = {
        "w": column("amplitude_pp_m", 0), "f": column("frequency_hz", 27500), "U": column("speed_m_s", 0.02),
        "F": np.maximum(column("normal_force_n", 0), 1e-3), "dir": column("direction", 1), "t": column("time_s", 0),
        "x": column("position_m", 0), "p": column("ambient_pressure_pa", 101325), "y": column("lateral_force_n", 0),
    }
    return d, tomllib.load(open(rig, "rb"))


def deviations(columns, r):
    """Of each column alone, about the mean: its slope in standard deviations and the share of r that it takes."""
    if len(r) < 6:
        return np.zeros(2 * columns.shape[1])
    x = columns - columns.mean(0)
    centred = r - r.mean()
    norm = np.sqrt((x**2).sum(0))
    t = np.where(norm > 1e-9, centred @ x / np.maximum(norm, 1e-9), 0)
    return np.concatenate([t, t / max(np.sqrt((centred**2).sum()), 1e-9)])


def scaled(v):
    sd = v.std()
    return (v - v.mean()) / sd if sd > 1e-12 else 0 * v


def features(table, rig):
    d, rig = read(table, rig)
    finger, noise = rig["finger"], rig["noise"]
    kn0, kl0, ksd = (finger[k] for k in ("normal_stiffness_n_per_m", "lateral_stiffness_n_per_m", "stiffness_relative_sd"))
    y, still = d["y"], d["w"] < 1e-12
    base = still if still.sum() > 3 else np.ones(len(y), bool)
    mu0 = max((d["dir"] * y * d["F"])[base].sum() / (d["F"][base] ** 2).sum(), 0.05)
    sd = np.sqrt((noise["pass_relative_sd"] * y) ** 2 + (noise["pass_relative_sd"] * 0.2 * mu0 * d["F"]) ** 2
                 + noise["force_sd_n"] ** 2 * (1 + mu0**2))

    def law(u, **other):
        c = {**d, **other}
        return d["dir"] * slider(np.exp(u[0]), np.exp(u[1]), np.exp(u[2]), c["w"], c["f"], c["U"], c["F"])

    def misfit(u):
        return np.concatenate([(y - law(u)) / sd, [(u[1] - np.log(kn0)) / ksd, (u[2] - np.log(kl0)) / ksd]])

    best = least_squares(misfit, [np.log(mu0), np.log(kn0), np.log(kl0)], loss="soft_l1", max_nfev=25)
    u = best.x
    model = law(u)
    signed = (y - model) / sd
    along = d["dir"] * signed
    moving = ~still
    t = scaled(d["t"])
    cov = {k: scaled(np.log(np.maximum(d[k], 1e-12))) for k in ("U", "F", "f", "p")}
    cov["w"] = scaled(np.where(moving, np.log(np.maximum(d["w"], 1e-9)), 0))
    cov.update(t=t, x=scaled(d["x"]), dir=d["dir"], e=np.exp(-3 * (d["t"] - d["t"].min()) / max(np.ptp(d["t"]), 1e-9)))
    names = list(cov)
    terms = [cov[k] for k in names] + [cov[a] * cov[b] for i, a in enumerate(names) for b in names[i:]]
    terms = np.stack(terms, 1)
    weight = np.abs(mu0 * d["F"]) / sd  # a change of the relative friction by one, in standard deviations
    relative = np.nan_to_num(along / weight)
    step = 0.02
    slopes = [(law(u, **{k: d[k] * (1 + step)}) - law(u, **{k: d[k] * (1 - step)})) / (2 * step) / sd for k in "wUF"]
    slopes.append((law(u + [0, step, 0]) - law(u - [0, step, 0])) / (2 * step) / sd)
    slopes.append((law(u + [0, 0, step]) - law(u - [0, 0, step])) / (2 * step) / sd)
    by = [np.ones_like(t), cov["F"], cov["w"], cov["U"], cov["f"], cov["p"], t, cov["e"], cov["x"]]
    shaped = np.stack([s * b for s in slopes for b in by] + [d["dir"] * weight * b for b in by], 1)
    forces = np.stack([1 / sd, d["F"] / sd, t / sd, cov["e"] / sd, d["F"] * t / sd, y * d["dir"] / sd, d["x"] / sd], 1)

    def through(columns, r):
        norm = np.sqrt((columns**2).sum(0))
        s = np.where(norm > 1e-9, r @ columns / np.maximum(norm, 1e-9), 0)
        return np.concatenate([s, s / max(np.sqrt((r**2).sum()), 1e-9)])

    parts = [
        deviations(terms[moving], along[moving]),
        deviations(terms[moving], (relative * np.median(weight))[moving]),
        through(shaped, signed), through(forces, signed), through(forces[still], signed[still]),
        deviations(terms[still][:, : len(names)], along[still]),
    ]
    # The strongest period along the path, of friction and of what a change of amplitude or of speed does.
    for carrier in (d["dir"] * weight, slopes[0], slopes[1]):
        k = 2 * np.pi / np.geomspace(0.0008, 0.04, 60)
        phase = k[:, None] * d["x"][None, :]
        power = []
        for wave in (np.cos(phase), np.sin(phase)):
            c = wave * carrier
            power.append((c @ signed) ** 2 / np.maximum((c**2).sum(1), 1e-9))
        power = power[0] + power[1]
        parts.append([np.sqrt(power.max()), power.max() / (signed**2).sum(), np.log(k[power.argmax()])])
    chi2 = lambda m: (signed[m] ** 2).mean() if m.any() else 0
    scale = np.abs(signed)
    parts.append([chi2(moving), chi2(still), (signed**2).sum() - len(signed), (u[1] - np.log(kn0)) / ksd,
                  (u[2] - np.log(kl0)) / ksd, scale.max(), np.median(scale), len(signed), mu0, np.exp(u[0]) / mu0,
                  still.mean(), np.corrcoef(signed[:-1], signed[1:])[0, 1]])
    return np.nan_to_num(np.concatenate([np.atleast_1d(p) for p in parts])).astype(np.float32)


def learnt(root):
    """Tables and names of the sealed sets with one cause that shows, of strangers that show, and of none."""
    for folder in sorted((root / "open").iterdir()):
        label = root / "sealed" / folder.name / "label.toml"
        if not label.exists():
            continue
        label = tomllib.load(open(label, "rb"))
        causes = label.get("causes", [])
        if len(causes) > 1 or (causes and label["chi2_gain"] < FAINT):
            continue
        name = "none" if not causes else causes[0]["name"] if causes[0]["in_library"] else "outside the library"
        yield folder / "points.csv", folder / "rig.toml", name


def tried(root, parity):
    for folder in sorted(p for p in root.iterdir() if p.is_dir()):
        if int(folder.name.split("-")[-1]) % 2 != parity:
            continue
        truth = json.load(open(folder / "truth.json"))
        cause = truth["cause"] or ["none"]
        if len(cause) == 1 and (truth["detectable"] or cause == ["none"]):
            yield folder / "train.csv", folder / "rig.toml", cause[0]


def score(title, truth, probability, classes):
    top, sure = classes[probability.argmax(1)], probability.max(1) >= CERTAIN
    truth = np.array(truth)
    single = ~np.isin(truth, ["none", "outside the library"])
    effect = ~np.isin(top, ["none", "outside the library"])
    right = top == truth
    count = lambda m: int(m.sum())
    print(f"{title}: single causes {count(single)}: named right {count(single & right)}, with {CERTAIN} or more "
          f"{count(single & right & sure)}, another cause with {CERTAIN} or more {count(single & ~right & effect & sure)}, "
          f"anything wrong with {CERTAIN} or more {count(single & ~right & sure)}; "
          f"strangers {count(truth == 'outside the library')}: said {count(right & (truth == 'outside the library'))}, "
          f"a cause with {CERTAIN} or more {count((truth == 'outside the library') & effect & sure)}; "
          f"none {count(truth == 'none')}: said {count(right & (truth == 'none'))}, "
          f"a cause with {CERTAIN} or more {count((truth == 'none') & effect & sure)}")
    return top


def main():
    sealed, sets = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    parity = {"even": 0, "odd": 1}[sys.argv[3] if len(sys.argv) > 3 else "even"]
    data = {}
    for what, listed in (("learnt", list(learnt(sealed))), ("tried", list(tried(sets, parity)))):
        rows = Parallel(n_jobs=2)(delayed(features)(table, rig) for table, rig, _ in listed)
        data[what] = np.array(rows), np.array([name for _, _, name in listed]), [t.parent.name for t, _, _ in listed]
    x, names, _ = data["learnt"]
    print(f"{len(names)} sets learnt from, {x.shape[1]} features, {dict(collections.Counter(names.tolist()))}", flush=True)
    makers = {
        "random forest": RandomForestClassifier(800, class_weight="balanced_subsample", n_jobs=2, random_state=1),
        "gradient boosting": HistGradientBoostingClassifier(
            learning_rate=0.08, max_iter=120, max_leaf_nodes=8, max_features=0.2, l2_regularization=1.0, random_state=1),
    }
    z, truth, folders = data["tried"]
    for title, maker in makers.items():
        if title == "random forest":
            folds = StratifiedKFold(4, shuffle=True, random_state=1)
            inner = cross_val_predict(maker, x, names, cv=folds, method="predict_proba")
            score(f"{title}, left-out quarters of what it learns from", names, inner, np.unique(names))
        maker.fit(x, names)
        probability = maker.predict_proba(z)
        top = score(f"{title}, sets of the other generator", truth, probability, maker.classes_)
        for folder, name, answer, p in zip(folders, truth, top, probability.max(1)):
            print(f"  {folder} {name:28} -> {answer} {p:.2f}")
        sys.stdout.flush()


if __name__ == "__main__":
    main()
