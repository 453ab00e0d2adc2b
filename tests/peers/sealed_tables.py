#!/usr/bin/env python3
"""Tables with a withheld cause, from an independent time-domain simulation (numpy; no code shared with muprime).

usage: sealed_tables.py OUT --sets N --seed S [--tier single|none|outside|pair|mixed]
Each set is a folder: table.csv, rig.toml, conditions.csv (hidden passes without lateral force),
hidden.csv (their noise-free lateral force) and label.json (only the scorer reads it).
The contact is marched in time on a grid of the cycle; every cause has a formula of its own here.
"""
import argparse
import json
import os

import numpy as np

T_GRID = 360


class World:
    """Arrays over passes of everything the contact needs; causes change them."""

    def __init__(self, d, mu0, kn, kl):
        self.d = d
        n = len(d["w"])
        self.w = d["w"].copy()
        self.f = d["f"].copy()
        self.U = d["U"].copy()
        self.F = d["F"].copy()
        self.mu = np.full(n, mu0)
        self.kn = np.full(n, kn)
        self.kl = np.full(n, kl)
        self.mu0 = mu0
        self.solid = np.ones(n)
        self.extra = {}
        self.after = []


def march(s):
    """Mean friction (unsigned) by marching the lateral spring through cycles."""
    n = len(s.w)
    ex = s.extra
    a = s.w / 2
    th = 2 * np.pi * np.arange(T_GRID) / T_GRID
    z = a[:, None] * np.sin(th)[None, :]
    Fc = s.F * s.solid
    if "mass" in ex:
        force = bounce(s, Fc, ex["mass"], ex["zeta"], ex["rest"])
    elif "maxwell" in ex:
        # standard linear solid: extra spring k1 in series with a dashpot, beside kn
        force = zener(s, Fc, *ex["maxwell"])
    else:
        heights = ex.get("heights", np.zeros((1, 1)))  # n x m or 1 x m
        m = heights.shape[1]
        lo = -a - np.abs(heights).max() - 1e-12
        hi = Fc / s.kn + a + np.abs(heights).max()
        pull = ex.get("pull", 0.0)
        for _ in range(55):
            mid = 0.5 * (lo + hi)
            tot = 0
            for j in range(m):
                q = s.kn[:, None] * (z + mid[:, None] + heights[:, j : j + 1])
                tot = tot + np.where(q > -pull, q, 0.0).mean(1) / m
            up = tot > Fc
            hi = np.where(up, mid, hi)
            lo = np.where(up, lo, mid)
        mid = 0.5 * (lo + hi)
        force = []
        for j in range(m):
            q = s.kn[:, None] * (z + mid[:, None] + heights[:, j : j + 1])
            force.append(np.where(q > -pull, q + pull, 0.0))
    if not isinstance(force, list):
        force = [force]
    out = 0
    for fo in force:
        out = out + lateral(s, fo) / len(force)
    still = s.w < 1e-12
    lim = limit_function(s, (Fc + ex.get("pull", 0.0))[:, None], np.full((n, 1), 1.0))[:, 0]
    return np.where(still, lim, out)


def limit_function(s, fo, age):
    ex = s.extra
    q = s.mu[:, None] * fo
    if "power" in ex:
        n_, ref = ex["power"]
        q = s.mu[:, None] * ref * (np.maximum(fo, 0) / ref) ** n_
    if "bond" in ex:
        tau, kind = ex["bond"]
        q = q * (age / (age + tau) if kind == 0 else (1 - 1 / (1 + age / tau) ** 2) if kind == 1 else np.tanh(age / tau))
    return q


def lateral(s, fo):
    ex = s.extra
    n = len(s.w)
    dt = 1 / s.f / T_GRID
    x = np.zeros(n)
    age = np.zeros(n)
    touching_all = (fo > 0).all(1)
    # A finger that never leaves starts fully stretched: it slips into its steady state within the cycle.
    x = np.where(touching_all, s.mu * fo.max(1) / s.kl, x)
    mean = np.zeros(n)
    cycles = 60 if ("vr" in ex or "tau_l" in ex) else 3
    for c in range(cycles):
        mean[:] = 0
        for i in range(T_GRID):
            f = fo[:, i]
            on = f > 0
            age = np.where(on, age + dt, 0.0)
            age = np.where(touching_all, 1.0, age)
            lim = limit_function(s, f[:, None], age[:, None])[:, 0]
            grown = x + s.U * dt
            bound = lim / s.kl
            if "vr" in ex:
                slow = np.maximum(x - ex["vr"] * dt, bound)
                off = np.maximum(x - ex["vr"] * dt, 0)
            elif "tau_l" in ex:
                # power-law creep recovery: rate falls as the stretch vanishes
                k = dt / ex["tau_l"]
                slow = np.maximum(x - k * x, bound)
                off = np.maximum(x - k * x, 0)
            else:
                slow, off = bound, 0 * x
            slip = grown > bound
            fl = np.where(on, np.where(slip, lim, s.kl * grown), 0)
            x = np.where(on, np.where(slip, np.where(x > bound, slow, bound), grown), off)
            mean += fl / T_GRID
    return mean


def zener(s, Fc, k1r, tau):
    a = s.w / 2
    n = len(s.w)
    d = Fc / s.kn - a * 0.3
    dt = 1 / s.f / T_GRID
    k1 = k1r * s.kn
    # free skin with a small inertia-less law: skin position y; force = kn (y+d) + q ; q' = k1 y' - q/tau
    for c in range(60):
        if c == 0:
            y = a.copy() * 0
            q = np.zeros(n)
            yprev = y
        out = np.zeros((n, T_GRID))
        for i in range(T_GRID):
            zz = a * np.sin(2 * np.pi * (i + 1) / T_GRID)
            # candidate free: force zero: kn(y+d)+q=0 with q = (q0 + k1 (y-y0))/(1+dt/tau)
            b = 1 / (1 + dt / tau)
            yfree = (-s.kn * d - (q - k1 * y) * b) / (s.kn + k1 * b)
            on = zz > yfree
            ynew = np.where(on, zz, yfree)
            q = (q + k1 * (ynew - y)) * b
            y = ynew
            out[:, i] = np.where(on, np.maximum(s.kn * (y + d) + q, 0), 0)
        d = d + 0.5 * (Fc - out.mean(1)) / s.kn
    return out


def bounce(s, Fc, mass, zeta, rest):
    n = len(s.w)
    a = np.maximum(s.w / 2, 1e-12)
    per = 1 / s.f
    sub = 4
    dt = per / (T_GRID * sub)
    om = 2 * np.pi * s.f
    kp = 60 * s.kn
    cp = 2 * np.sqrt(kp * mass) * rest
    c = 2 * zeta * np.sqrt(s.kn * mass)
    d = np.where(Fc / s.kn > a, Fc / s.kn, -0.4 * a)
    x = a * 0
    v = a * om
    acc_force = np.zeros((n, T_GRID))
    for cyc in range(70):
        out = np.zeros((n, T_GRID))
        for i in range(T_GRID):
            for k in range(sub):
                t = (i + k / sub) / T_GRID * per
                pl = a * np.sin(om * t)
                pv = a * om * np.cos(om * t)
                pen = pl - x
                F = np.where(pen > 0, np.maximum(kp * pen + cp * (pv - v), 0), 0)
                v = v + (F - s.kn * (x + d) - c * v) / mass * dt
                x = x + v * dt
                out[:, i] += F / sub
        d = d + 0.2 * (Fc - out.mean(1)) / s.kn
        if cyc >= 62:
            acc_force = out  # last cycle
    return out


# ---- causes: (name, function(world, size in 0..1, rng) -> parameters) ----
def span(lo, hi, x):
    return lo * (hi / lo) ** x


def c_squeeze_film(s, x, r):
    p = s.d["p"] / 101325
    g = span(0.15, 4, x)
    s.solid = s.solid / (1 + g * p**0.8 * (s.w / 2e-6) ** 1.7 * (0.3 / s.F) ** 0.3)


def c_lateral_recovery(s, x, r):
    if r.random() < 0.5:
        s.extra["vr"] = span(0.1, 1.5e-3, x)
    else:
        s.extra["tau_l"] = span(3e-6, 120e-6, x)


def c_ridge_inertia(s, x, r):
    s.extra.update(mass=span(1e-6, 12e-6, x), zeta=r.choice([0.25, 0.5, 1.0]), rest=r.choice([0.3, 1.0]))


def c_normal_damping(s, x, r):
    s.extra["maxwell"] = (span(0.1, 4, x), 3e-6 * span(0.5, 2, r.random()))


def c_load_dependent_friction(s, x, r):
    e = span(0.02, 0.3, x)
    if r.random() < 0.6:
        s.extra["power"] = (1 - e, 0.4)
    else:
        s.mu = s.mu * ((s.F + 0.08) / 0.5) ** (-e)


def c_contact_ageing(s, x, r):
    s.extra["bond"] = (span(0.5e-6, 40e-6, x), int(r.integers(3)))


def c_rate_dependent_friction(s, x, r):
    k = span(0.03, 0.5, x) * r.choice([-1, 1])
    if r.random() < 0.5:
        s.mu = s.mu * np.maximum(1 + 0.5 * k * np.log1p(s.U / 0.01), 0.1)
    else:
        s.mu = s.mu * (1 + k / (1 + s.U / 0.03))


def c_adhesion(s, x, r):
    fa = span(0.005, 0.25, x)
    s.extra["pull"] = fa * 0.7
    s.mu = s.mu * (1 + 0.3 * fa / (s.F + 0.2))


def c_moisture_drift(s, x, r):
    t = s.d["t"]
    T = t.max() * span(0.1, 1.2, r.random())
    g = span(0.03, 1.5, x)
    sgn = 1 if r.random() < 0.75 else -0.5
    if r.random() < 0.5:
        s.mu = s.mu * (1 + sgn * g * t / (t + T))
    else:
        s.mu = s.mu * (1 + sgn * g * (1 - 1 / (1 + (t / T) ** 1.3)))
        s.kl = s.kl / (1 + 0.3 * sgn * g * t / (t + T))


def c_multi_asperity(s, x, r):
    sg = span(0.1e-6, 4e-6, x)
    k = 9
    u = (np.arange(k) + 0.5) / k
    if r.random() < 0.5:
        h = np.log(u / (1 - u)) * 0.55 * sg  # logistic heights
    else:
        h = (u - 0.5) * 3.4 * sg  # uniform heights
    s.extra["heights"] = h[None, :] - h.mean()


def c_subsurface_relaxation(s, x, r):
    t = s.d["t"]
    g = span(0.05, 2, x)
    T = t.max() * span(0.05, 0.6, r.random())
    k = 1 + g * np.sqrt(t / (t + T))
    s.kn = s.kn * k
    s.kl = s.kl * k


def c_stiffness_error(s, x, r):
    g = np.exp(span(0.1, 0.9, x) * r.choice([-1, 1]))
    if r.random() < 0.5:
        s.kl = s.kl * g
    else:
        s.kn = s.kn * g


def c_amplitude_miscalibration(s, x, r):
    s.w = s.w * np.exp(span(0.05, 0.7, x) * r.choice([-1, 1]))


def c_amplitude_droop(s, x, r):
    g = span(0.1, 5, x)
    s.w = s.w / np.sqrt(1 + (g * s.F**0.8) ** 2 + g * s.F**0.8)


def c_amplitude_saturation(s, x, r):
    lim = span(1.1, 0.3, x) * s.d["w"].max()
    k = 8
    s.w = np.where(s.w > 0, (np.maximum(s.w, 1e-12) ** -k + lim**-k) ** (-1 / k), 0)


def c_resonance_detuning(s, x, r):
    g = span(0.2, 5, x)
    if s.d["T"] is not None and r.random() < 0.6:
        det = g * (s.d["T"] - s.d["T"][np.argmin(s.d["t"])]) / max(np.ptp(s.d["T"]), 1e-9)
    else:
        det = g * (s.d["t"] / s.d["t"].max()) ** 0.8
    s.w = s.w / (1 + 0.8 * det**2) ** 0.5 if r.random() < 0.7 else s.w * np.exp(-0.35 * np.abs(det))


def c_mode_shape(s, x, r):
    lam = r.uniform(0.012, 0.045)
    ph = r.uniform(0, 2 * np.pi)
    dep = span(0.04, 0.9, x)
    s.w = s.w * (1 - dep * (0.5 - 0.5 * np.cos(2 * np.pi * s.d["x"] / lam * 2 + ph)) ** 1.2)


def c_force_crosstalk(s, x, r):
    c = span(0.003, 0.12, x) * r.choice([-1, 1])
    s.after.append(lambda L: L + c * s.d["F"] * (1 + 0.05 * s.d["F"]))


def c_plate_tilt(s, x, r):
    c = span(0.003, 0.12, x) * r.choice([-1, 1])
    s.after.append(lambda L: L * np.cos(c) + s.d["F"] * np.sin(c))


def c_lateral_offset_drift(s, x, r):
    c = span(0.001, 0.06, x) * r.choice([-1, 1])
    t = s.d["t"] / s.d["t"].max()
    k = r.integers(3)
    prof = [np.ones_like(t), t**1.3, np.sin(1.7 * t)][k]
    s.after.append(lambda L: L + c * prof)


def c_normal_offset(s, x, r):
    b = span(0.003, 0.09, x) * r.choice([-1, 1])
    s.F = np.maximum(s.F - b * (1 + 0.1 * s.d["t"] / s.d["t"].max()), 0.02)


def c_speed_error(s, x, r):
    if r.random() < 0.5:
        s.U = s.U * np.exp(span(0.08, 0.6, x) * r.choice([-1, 1]))
    else:
        s.U = s.U + span(0.0003, 0.01, x)


def c_speed_ripple(s, x, r):
    p = r.uniform(0.001, 0.01)
    k = span(0.05, 0.8, x)
    ph = r.uniform(0, 2 * np.pi)
    ang = 2 * np.pi * s.d["x"] / p + ph
    s.U = s.U * (1 + k * (np.sin(ang) + 0.2 * np.sin(2 * ang)))


# ---- strangers: no effect of any library ----
def o_electro(s, x, r):
    """electrostatic pull that flips with every pass hour: friction hump at one speed"""
    c = span(0.05, 0.9, x)
    s.after.append(lambda L: L * (1 + c * np.exp(-(np.log(s.d["U"] / 0.03) / 0.35) ** 2)))


def o_inplane(s, x, r):
    """in-plane vibration: dither reduces friction when a f exceeds U"""
    c = span(0.05, 0.8, x)
    vib = s.d["w"] * s.d["f"] * 0.3
    s.after.append(lambda L: L * (1 - c * (2 / np.pi) * np.arcsin(np.minimum(1, vib / (s.d["U"] + vib + 1e-9)))))


def o_direction(s, x, r):
    """grain: friction differs by direction in proportion to friction"""
    c = span(0.01, 0.3, x)
    s.after.append(lambda L: L * (1 + c * s.d["dir"]))


def o_bump(s, x, r):
    """dirt on the plate: friction raised on one stretch, with the plate still too"""
    c = span(0.05, 1, x)
    x0 = r.uniform(0.2, 0.8) * s.d["x"].max()
    s.after.append(lambda L: L * (1 + c * np.exp(-((s.d["x"] - x0) / (0.12 * np.ptp(s.d["x"]))) ** 2)))


def o_wearstep(s, x, r):
    """something broke: friction under vibration steps up in mid-run"""
    c = span(0.05, 1, x)
    t0 = r.uniform(0.3, 0.7) * s.d["t"].max()
    s.after.append(lambda L: L * (1 + c * (s.d["t"] > t0) * (s.d["w"] > 0)))


def o_floor(s, x, r):
    """a seal rubs: constant friction force against the motion, only while moving fast"""
    c = span(0.001, 0.05, x)
    s.after.append(lambda L: L + s.d["dir"] * c * (s.d["U"] / 0.05) ** 0.7)


def o_beat(s, x, r):
    """second mode excited: friction depends on w through an interference with frequency"""
    c = span(0.05, 0.8, x)
    s.after.append(lambda L: L * (1 + c * np.sin(2.2 * s.d["w"] / 1e-6 + s.d["F"] * 4)))


def o_humidity(s, x, r):
    """slow cyclic drift of friction (air conditioning)"""
    c = span(0.03, 0.5, x)
    per = s.d["t"].max() / r.uniform(1.5, 4)
    s.after.append(lambda L: L * (1 + c * np.sin(2 * np.pi * s.d["t"] / per)))


CAUSES = {k[2:]: v for k, v in globals().items() if k.startswith("c_")}
STRANGERS = {k[2:]: v for k, v in globals().items() if k.startswith("o_")}
ALIASES = [
    {"force_crosstalk", "plate_tilt"},
    {"stiffness_error", "speed_error", "lateral_gain", "amplitude_miscalibration"},
]


def design(r, n_extra_hidden):
    mu0 = r.uniform(0.3, 1.0)
    kn = 10 ** r.uniform(5.8, 6.7)
    kl = kn / (2 * (1 + 0.33)) * np.exp(r.normal() * 0.15)
    nf = r.choice([1, 2, 2, 3])
    fs = np.sort(r.choice([22000, 25000, 27500, 32000, 38000, 45000, 60000], nf, replace=False))
    ws = np.concatenate([[0.0], np.geomspace(r.uniform(0.3e-6, 0.6e-6), r.uniform(2.5e-6, 6e-6), r.integers(4, 7))])
    us = np.geomspace(r.uniform(2e-3, 8e-3), r.uniform(0.08, 0.25), r.integers(3, 5))
    fn = np.geomspace(r.uniform(0.1, 0.2), r.uniform(0.6, 1.2), r.integers(2, 5))
    dirs = [1, -1]
    press = [101325.0] if r.random() < 0.5 else [101325.0, r.choice([20000.0, 50000.0])]
    rows = [(w, f, u, q, p) for w in ws for f in fs for u in us for q in fn for p in press]
    r.shuffle(rows)
    n = int(r.integers(120, 420))
    pick = rows[: min(len(rows), n)]
    if len(pick) < n:
        pick = pick + [rows[i] for i in r.integers(0, len(rows), n - len(pick))]
    zero = [(0.0, fs[0], us[r.integers(len(us))], fn[r.integers(len(fn))], press[0]) for _ in range(max(8, n // 10))]
    rep = [pick[i] for i in r.integers(0, len(pick), n // 8)]
    train = pick + zero + rep
    # hidden: off-grid conditions within the ranges
    m = n_extra_hidden
    hid = []
    for _ in range(m):
        w = 0.0 if r.random() < 0.1 else np.exp(r.uniform(np.log(ws[1]), np.log(ws[-1])))
        hid.append((w, fs[r.integers(nf)], np.exp(r.uniform(np.log(us[0]), np.log(us[-1]))),
                    np.exp(r.uniform(np.log(fn[0]), np.log(fn[-1]))), press[r.integers(len(press))]))
    allr = np.array(train + hid, float)
    order = np.arange(len(allr))
    N = len(allr)
    stroke = r.uniform(0.02, 0.06)
    t = np.sort(r.uniform(0, 1, N)) * N * r.uniform(2, 6)
    t = t[r.permutation(N)]
    hidden = np.zeros(N, bool)
    hidden[len(train):] = True
    temp = None
    if r.random() < 0.6:
        temp = 22 + r.uniform(2, 12) * (1 - np.exp(-t / (t.max() * r.uniform(0.2, 1)))) + r.normal(size=N) * 0.05
    d = dict(w=allr[:, 0], f=allr[:, 1], U=allr[:, 2], F=allr[:, 3] * np.exp(0.03 * r.normal(size=N)), p=allr[:, 4],
             dir=np.array(dirs)[r.integers(0, 2, N)].astype(float), t=t, x=r.uniform(0.1, 0.9, N) * stroke, T=temp)
    return d, hidden, mu0, kn, kl, len(press) > 1


def simulate(d, mu0, kn, kl, causes, r, sizes):
    s = World(d, mu0, kn, kl)
    for (fn, st), x in zip(causes, sizes):
        fn(s, x, np.random.default_rng(st))
    L = d["dir"] * march(s)
    for g in s.after:
        L = g(L)
    return L


def oracle(d, y, sigma, mu0, kn, kl, ksd, sel):
    """chi2 left by the recalibrated baseline on noise-free data, and its prediction."""
    p = np.zeros(3)

    def model(p):
        s = World(d, mu0 * np.exp(p[0]), kn * np.exp(p[1]), kl * np.exp(p[2]))
        return d["dir"] * march(s)

    m = model(p)
    for _ in range(4):
        J = np.stack([(model(p + 0.01 * np.eye(3)[k]) - m) / 0.01 for k in range(3)], 1)
        W = 1 / sigma[sel]
        A = J[sel] * W[:, None]
        b = (y - m)[sel] * W
        H = A.T @ A + np.diag([1 / 1.0**2, 1 / ksd**2, 1 / ksd**2])
        step = np.linalg.solve(H, A.T @ b - np.array([1, 1 / ksd**2, 1 / ksd**2]) * p)
        p = p + np.clip(step, -0.5, 0.5)
        m = model(p)
    chi = (((y - m) / sigma)[sel] ** 2).sum() + (p[1:] ** 2).sum() / ksd**2
    return chi, m


def write_set(path, seed, tier):
    r = np.random.default_rng(seed)
    d, hidden, mu0, kn, kl, pressure = design(r, 80)
    if tier == "mixed":
        tier = r.choice(["none", "single", "pair", "outside"], p=[0.2, 0.5, 0.1, 0.2])
    names = []
    if tier in ("single", "pair"):
        names = list(r.choice(sorted(CAUSES), 2 if tier == "pair" else 1, replace=False))
        causes = [(CAUSES[k], int(r.integers(1 << 30))) for k in names]
    elif tier == "outside":
        k = r.choice(sorted(STRANGERS))
        names = ["outside:" + k]
        causes = [(STRANGERS[k], int(r.integers(1 << 30)))]
    else:
        causes = []
    sizes = r.uniform(0, 1, len(causes))
    ksd = 0.05
    true_kn = kn * np.exp(ksd * r.normal())
    true_kl = kl * np.exp(ksd * r.normal())
    L = simulate(d, mu0, true_kn, true_kl, causes, r, sizes)
    prs, fsd = r.choice([0.01, 0.015, 0.02]), r.choice([0.0004, 0.0008])
    heavy = r.random() < 0.3
    e = r.standard_t(5, len(L)) / np.sqrt(5 / 3) if heavy else r.normal(size=len(L))
    sigma = np.sqrt((prs * L) ** 2 + fsd**2 * (1 + mu0**2 * 0.3))
    y = L + prs * np.abs(L) * e + fsd * r.normal(size=len(L))
    Fm = d["F"] + fsd * r.normal(size=len(L))
    tr = ~hidden
    chi, base = oracle(d, L, sigma, mu0, kn, kl, ksd, tr)
    os.makedirs(path, exist_ok=True)
    hastemp = d["T"] is not None
    cols = ["point", "time_s", "amplitude_pp_m", "frequency_hz", "speed_m_s", "direction", "position_m", "normal_force_n"]
    with open(f"{path}/table.csv", "w") as a, open(f"{path}/conditions.csv", "w") as b, open(f"{path}/hidden.csv", "w") as h:
        extra = (["ambient_pressure_pa"] if pressure else []) + (["temperature_c"] if hastemp else [])
        a.write(",".join(cols + ["lateral_force_n"] + extra) + "\n")
        b.write(",".join(cols + extra) + "\n")
        h.write("point,lateral_force_n,recalibrated_n,scale_n,sigma_n\n")
        for i in range(len(L)):
            row = [i, f"{d['t'][i]:.3f}", f"{d['w'][i]:.6g}", f"{d['f'][i]:.6g}", f"{d['U'][i]:.6g}", int(d["dir"][i]),
                   f"{d['x'][i]:.6f}", f"{Fm[i]:.6f}"]
            ext = ([f"{d['p'][i]:.0f}"] if pressure else []) + ([f"{d['T'][i]:.3f}"] if hastemp else [])
            if hidden[i]:
                b.write(",".join(map(str, row + ext)) + "\n")
                h.write(f"{i},{L[i]:.8g},{base[i]:.8g},{mu0 * d['F'][i]:.8g},{sigma[i]:.8g}\n")
            else:
                a.write(",".join(map(str, row + [f"{y[i]:.7g}"] + ext)) + "\n")
    with open(f"{path}/rig.toml", "w") as f:
        f.write(f"[finger]\nnormal_stiffness_n_per_m = {kn:.6g}\nlateral_stiffness_n_per_m = {kl:.6g}\n"
                f"stiffness_relative_sd = {ksd}\npoisson_ratio = 0.33\n[noise]\npass_relative_sd = {prs}\nforce_sd_n = {fsd}\n")
    scale = mu0 * d["F"]
    gap = float(np.sqrt(np.mean((((L - base) / scale)[hidden]) ** 2)))
    floor = float(np.sqrt(np.mean(((sigma / scale)[hidden]) ** 2)))
    json.dump({"causes": names, "tier": str(tier), "sizes": list(map(float, sizes)), "chi2_gain": float(chi),
               "gap": gap, "floor": floor, "passes": int(tr.sum())}, open(f"{path}/label.json", "w"))


def main():
    ap = argparse.ArgumentParser()
    ap.add_argument("out")
    ap.add_argument("--sets", type=int, default=40)
    ap.add_argument("--seed", type=int, default=1)
    ap.add_argument("--tier", default="mixed")
    a = ap.parse_args()
    for k in range(a.sets):
        write_set(f"{a.out}/{k:04d}", a.seed * 100003 + k, a.tier)
        print(k, flush=True)


if __name__ == "__main__":
    main()
