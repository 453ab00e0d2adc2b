#!/usr/bin/env python3
"""Labelled tables of a finger on a vibrating plate, for `muprime diagnose`: the fourth generator (numpy, SciPy).

usage: fourth_generator.py OUT --seed S [--singles 110] [--pairs 30] [--none 20] [--strangers 40]

It was written from the names of the causes and one line of physics each, by the baseline's definition alone: its laws
are those of papers and data sheets on films, skin, adhesion, drives and sensors, and it shares no code with muprime or
the third generator. Each set is a folder with the files of third_generator.py, and its keys in truth.json; everything
follows from the seed, the stratum and the index.

Units are SI throughout.  Names used all over: w peak-to-peak amplitude, f frequency, U speed, F true mean normal force,
kn and kl normal and lateral stiffness, mu the friction coefficient of a pass, x position along the plate, t time,
rt time since the run began, T temperature, H humidity in percent, p ambient pressure, way the direction (+1 or -1).
"""
import argparse
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
from scipy.special import ndtri
from scipy.stats import qmc

HUMIDITY = "relative_humidity_pct"  # name of the humidity column
STEPS = 240                             # steps of one contact in the spring-slider
RIDGE_STEPS, RIDGE_CYCLES, RIDGE_KEPT = 400, 90, 44
P0, F0, KHZ30 = 101325.0, 0.3, 30e3     # reference pressure, load and frequency of the laws below
STRATA = ("single", "pair", "none", "stranger")
PHI = np.linspace(0.0, np.pi, 6001)     # half angle of a contact, and the mean force that goes with it
MEAN_OF_PHI = (np.sin(PHI) - PHI * np.cos(PHI)) / np.pi


# ---------------------------------------------------------------------------------------------------------------------
# The contact: normal force over the cycle, then the lateral spring

def bisect(function, low, high, turns):
    """Root of a vectorised function that is negative at `low` and positive at `high`."""
    low, high = low.copy(), high.copy()
    for _ in range(turns):
        middle = 0.5 * (low + high)
        below = function(middle) < 0
        low, high = np.where(below, middle, low), np.where(below, high, middle)
    return 0.5 * (low + high)


def plain_contact(q):
    """Start, end and depth (in half amplitudes) of the undamped contact; q = load / (kn * half amplitude)."""
    phi = np.interp(q, MEAN_OF_PHI, PHI)
    return -phi, phi, np.where(q >= 1, q, -np.cos(phi)), q >= 1


def voigt_contact(q, loss):
    """The same with a dashpot beside the spring: the skin, once let go, comes back exponentially and lags the plate."""
    big, psi = np.hypot(1, loss), np.arctan(loss)

    def times(depth):
        edge = np.arccos(np.clip(-depth / big, -1, 1))
        end = edge - psi
        left = np.cos(end) + depth                      # compression that is left when the plate lets go
        start = bisect(lambda z: np.cos(z) + depth - left * np.exp(-(z + 2 * np.pi - end) / loss),
                       -edge - psi, np.zeros_like(depth), 26)
        return start, end, left

    def excess(depth):
        start, end, left = times(depth)
        pressed = np.sin(end) - np.sin(start) + depth * (end - start)
        return (pressed + left * loss * (1 - np.exp(-(2 * np.pi - end + start) / loss))) / (2 * np.pi) - q

    depth = bisect(excess, np.full_like(q, -1.0), np.minimum(q, big), 32)
    start, end, _ = times(depth)
    whole = q >= big
    return start, end, np.where(whole, q, depth), whole


def pulled_contact(q, pull):
    """The same where the skin sticks until the spring pulls with `pull` (in kn * half amplitude) on the plate."""
    def times(depth):
        return -np.arccos(np.clip(-depth, -1, 1)), np.arccos(np.clip(-depth - pull, -1, 1))

    def excess(depth):
        start, end = times(depth)
        return (np.sin(end) - np.sin(start) + depth * (end - start)) / (2 * np.pi) - q

    whole = q >= 1 - pull
    depth = bisect(excess, np.full_like(q, -1.0), np.maximum(1 - pull, -1.0), 44)
    return *times(depth), np.where(whole, q, depth), whole


def uneven_contact(q, heights):
    """The same for asperities of unequal `heights` (passes x asperities, in half amplitudes), equal weights."""
    def mean_force(c):
        phi = np.arccos(np.clip(-c, -1, 1))
        return np.where(c >= 1, c, (np.sin(phi) + np.clip(c, -1, 1) * phi) / np.pi)

    bound = q * heights.shape[1] + heights.max(axis=1) + 2
    depth = bisect(lambda d: mean_force(d[:, None] - heights).mean(axis=1) - q, heights.min(axis=1) - 1.0, bound, 60)
    c = (depth[:, None] - heights).ravel()
    phi = np.arccos(np.clip(-c, -1, 1))
    return -phi, phi, c, c >= 1


def friction(m, steps=STEPS):
    """Mean friction force (N, positive) of every pass of the model `m` over one steady cycle."""
    if m.ridge is not None:
        return ridge_march(m)
    half, load = np.maximum(m.w / 2, 1e-13), m.F * m.borne
    kn, kl, mu, f, speed, count = m.kn, m.kl, m.mu, m.f, m.U, 1
    q = load / (kn * half)
    omega = 2 * np.pi * f
    if m.heights is not None:
        count = len(m.heights)
        start, end, depth, whole = uneven_contact(q, m.heights[None, :] / half[:, None])
        kn, kl = np.repeat(kn / count, count), np.repeat(kl / count, count)
        half, mu, f, speed, omega = (np.repeat(v, count) for v in (half, mu, f, speed, omega))
    elif m.loss is not None:
        start, end, depth, whole = voigt_contact(q, m.loss)
    elif m.pull is not None:
        start, end, depth, whole = pulled_contact(q, m.pull / (kn * half))
    else:
        start, end, depth, whole = plain_contact(q)
    start, end = np.where(whole, -np.pi, start), np.where(whole, np.pi, end)
    turned = (end - start)[:, None] * np.linspace(0, 1, steps + 1)
    angle = start[:, None] + turned
    time, cycle, lasts = turned / omega[:, None], 1 / f, (end - start) / omega
    normal = np.cos(angle) + depth[:, None]
    if m.loss is not None:
        normal -= m.loss[:, None] * np.sin(angle)
    normal *= (kn * half)[:, None]
    if m.rebound is not None:
        normal *= 1 + np.tanh(-(m.rebound * half * omega)[:, None] * np.sin(angle))
    held = normal if m.pull is None else normal + m.more(normal)
    held = np.maximum(held, 0)
    if m.area_power:
        held = held * np.maximum(held * count / F0, 1e-6) ** -m.area_power
    if m.bonded is not None:
        young = m.bonded(time, np.maximum(normal, 0), cycle[:, None])
        held = held * np.where(whole[:, None], 1, np.maximum(young, 0.01))
    limit = mu[:, None] * held
    path = speed[:, None] * time
    room = limit / kl[:, None] - path                 # the stretch is U t + the least room met since the contact began
    first = np.where(whole, room.min(axis=1) + speed * cycle, 0.0)
    stretch = np.minimum(np.minimum.accumulate(room, axis=1), first[:, None]) + path
    step = lasts / steps / cycle

    def mean(force):
        return (force.sum(axis=1) - 0.5 * (force[:, 0] + force[:, -1])) * step

    force = kl[:, None] * stretch
    total = mean(force)
    if m.kept is not None:                            # stretch left in the tissue adds to that of this contact
        for _ in range(12):
            left = np.where(whole, 0, m.kept(force.max(axis=1) / kl, total / kl, np.maximum(cycle - lasts, 0)))
            force = np.minimum(limit, kl[:, None] * (stretch + left[:, None]))
            total = mean(force)
    return total.reshape(-1, count).sum(axis=1)


def ridge_march(m, steps=RIDGE_STEPS):
    """Ridges of a mass between a surface spring and the finger's spring, marched until steady (leapfrog).

    The depth is steered from cycle to cycle so that the mean load is carried."""
    result, moving = m.mu * m.F, m.w > 0
    kn, kl, mu, f, speed, load, half = (v[moving] for v in (m.kn, m.kl, m.mu, m.f, m.U, m.F, m.w / 2))
    mass, stiffer, damping = m.ridge[0][moving], m.ridge[1], m.ridge[2]
    surface, inner = kn * stiffer, kn * stiffer / (stiffer - 1)
    start, end, depth, whole = plain_contact(load / (kn * half))
    share = np.where(whole, 1, (end - start) / (2 * np.pi))
    depth, dt = depth * half, 1 / (f * steps)
    push, drag = dt / mass, 2 * damping * np.sqrt(inner / mass) * dt
    y, v, stretch, gap = -depth.copy(), np.zeros_like(f), np.zeros_like(f), half + depth
    wave, way, grip = np.cos(2 * np.pi * (np.arange(steps) + 0.5) / steps), speed * dt, mu / kl
    kept = np.zeros_like(f)
    for cycle in range(RIDGE_CYCLES):
        sum_n, sum_s = np.zeros_like(f), np.zeros_like(f)
        for height in wave:
            y += (0.5 * dt) * v
            before, gap = gap, height * half - y
            normal = surface * np.maximum(gap, 0)
            v += push * (normal - inner * (y + depth)) - drag * v
            y += (0.5 * dt) * v
            fresh = np.where(before > 0, 1.0, np.clip(gap / np.maximum(gap - before, 1e-30), 0, 1))
            stretch = np.minimum(stretch + way * fresh, grip * normal)
            sum_n += normal
            sum_s += stretch
        if cycle >= RIDGE_CYCLES - RIDGE_KEPT:
            kept += sum_s
        depth = depth + (0.3 if cycle < RIDGE_CYCLES - RIDGE_KEPT else 0.1) * (load - sum_n / steps) / (kn * share)
    result[moving] = kl * kept / (steps * RIDGE_KEPT)
    return result


# ---------------------------------------------------------------------------------------------------------------------
# Helpers of the forms

def bear(air):
    """Share of the load that is left to the skin where the air would lift the share `air`; a few asperities remain."""
    return dict(borne=0.03 + 0.97 * np.exp(-air / 0.97))


def soaked(m, rise, fall):
    """State between 0 and 1 that rises within runs (time constant `rise`) and falls in the pauses (`fall`)."""
    state, out = 0.0, np.zeros_like(m.t)
    for run in np.unique(m.run):
        here = m.run == run
        begin = m.t[here][0]
        if run > m.run[0]:
            state *= np.exp(-(begin - ended) / fall)
        out[here] = 1 - (1 - state) * np.exp(-(m.t[here] - begin) / rise)
        state, ended = out[here][-1], m.t[here][-1]
    return out


def stiffen(m, log_normal, log_lateral):
    """Both stiffnesses by factors given as logarithms."""
    return dict(kn=m.kn * np.exp(log_normal), kl=m.kl * np.exp(log_lateral))


def off_peak(m, x):
    """Amplitude at the detuning x, in half bandwidths of a Lorentzian."""
    return dict(w=m.w / np.sqrt(1 + x ** 2))


def read(m, lateral=None, normal=None):
    """Adds to the readings: functions of (signed lateral force, true normal force)."""
    zero = lambda l, n: 0.0
    lateral, normal = lateral or zero, normal or zero
    return dict(read=m.read + [lambda l, n: (lateral(l, n), normal(l, n))])


def tilt(m, angle):
    """Readings of axes turned by `angle` against the plate."""
    c, s = np.cos(angle), np.sin(angle)
    return read(m, lambda l, n: l * (c - 1) + n * s, lambda l, n: n * (c - 1) - l * s)


def pace(m, speed):
    """True speed, which never falls below a tenth of the commanded one (soft edge)."""
    low = 0.1 * m.U
    return dict(U=low + 0.5 * (speed - low + np.hypot(speed - low, 0.05 * m.U)))


def quantiles(count):
    """Midpoints of `count` equally likely classes."""
    return (np.arange(count) + 0.5) / count


def age_by_pressing(s, tau):
    """Bonds form at a rate that follows the normal force of the instant, in its mean over a cycle."""
    def law(time, normal, cycle):
        dose = (np.cumsum(normal, axis=1) - 0.5 * (normal + normal[:, :1])) * time[:, 1:2]
        return 1 - s * np.exp(-dose / np.maximum(dose[:, -1:], 1e-15) * cycle / tau)
    return law


# ---------------------------------------------------------------------------------------------------------------------
# The forms: part of the model, cause, name, smallest and largest size, signed, ranges of shapes, needs, meaning, law
# (a law returns what it changes in the model `m`; needs: columns and designs without which it could not be seen)

U0, MM, UM, TAU = 0.02, 1e-3, 1e-6, 2 * np.pi
FORM_TABLE = [
    ("normal", "squeeze_film", "salbu_film", 1e-7, 8e-5, 0, [(1 * UM, 6 * UM)], "",
     "isothermal film over a rough gap h on an area s: p [sqrt((1 + 1.5 e^2)/(1 - e^2)) - 1], e = a/(a + h)",
     lambda m, s, h: bear(s * m.p / m.F * (np.sqrt((1 + 1.5 * (e := m.w / (m.w + 2 * h)) ** 2) / (1 - e ** 2)) - 1))),
    ("normal", "squeeze_film", "leaking_film", 0.01, 3.0, 0, [(0.6 * UM, 3 * UM), (5e3, 4e4)], "",
     "share of the load saturates with amplitude; air leaks out below a cut-off frequency that rises with pressure",
     lambda m, s, wc, fc: bear(s * m.p / P0 * m.w ** 2 / (m.w ** 2 + wc ** 2) / (1 + (fc * m.p / (P0 * m.f)) ** 2))),
    ("normal", "squeeze_film", "radiation_lift", 5e-4, 1.0, 0, [(0.2, 0.6)], "",
     "lift by the square of the plate's velocity and the air's density, on an area that grows with load",
     lambda m, s, n: bear(s * m.p / P0 * (m.w * m.f / 0.06) ** 2 * (m.F / F0) ** n / m.F)),
    ("shear", "lateral_recovery", "fading_peak", 0.01, 1.5, 0, [(5e-6, 60e-6)], "",
     "a share of the last contact's peak stretch is left, fading exponentially while off the plate",
     lambda m, s, tau: dict(kept=lambda peak, mean, off: s * peak * np.exp(-off / tau))),
    ("shear", "lateral_recovery", "power_law_tissue", 0.01, 1.5, 0, [(3e-6, 20e-6), (0.5, 1.2)], "",
     "the same with the slow power law of tissue that has many relaxation times",
     lambda m, s, tau, n: dict(kept=lambda peak, mean, off: s * peak / (1 + (off / tau) ** n))),
    ("shear", "lateral_recovery", "bulk_shear", 0.01, 4.0, 0, [(30e-6, 200e-6)], "",
     "the deep tissue holds a stretch after the cycle's mean force, which adds to that of each contact",
     lambda m, s, tau: dict(kept=lambda peak, mean, off: s * mean * np.exp(-off / tau))),
    ("ridge", "ridge_inertia", "resting_ridges", 2e-6, 1.5e-4, 0, [(1.5, 4.0), (0.05, 0.3)], "",
     "a ridge mass between surface spring and finger spring (ratio of surface to whole stiffness, damping ratio)",
     lambda m, s, ratio, zeta: dict(ridge=(s + 0 * m.F, ratio, zeta))),
    ("ridge", "ridge_inertia", "area_ridges", 2e-6, 1.5e-4, 0, [(1.5, 4.0), (0.05, 0.3)], "",
     "the same where the mass of ridges in touch grows with load as the contact area, F^(2/3)",
     lambda m, s, ratio, zeta: dict(ridge=(s * (m.F / F0) ** (2 / 3), ratio, zeta))),
    ("normal", "normal_damping", "voigt_disc", 5e-8, 1.2e-5, 0, [(0.0, 0.4)], "",
     "dashpot with time constant s that grows a little with load, as the radius of the contact",
     lambda m, s, n: dict(loss=TAU * m.f * s * (m.F / F0) ** n)),
    ("normal", "normal_damping", "hysteretic_loss", 0.01, 2.0, 0, [(-0.3, 0.5)], "",
     "loss tangent of tissue that hardly depends on frequency: s (f/30 kHz)^m",
     lambda m, s, n: dict(loss=s * (m.f / KHZ30) ** n)),
    ("normal", "normal_damping", "hunt_crossley", 0.05, 25.0, 0, [], "",
     "damping in proportion to the indentation (no jump at touch-down), limited at high velocity",
     lambda m, s: dict(rebound=s + 0 * m.F)),
    ("level", "load_dependent_friction", "two_term_shear", 0.01, 0.9, 1, [(0.25, 0.4)], "",
     "shear strength times area plus a Coulomb part: (1 - s) + s (F/0.3)^-n",
     lambda m, s, n: dict(mu=m.mu * (1 - s + s * (m.F / F0) ** -n))),
    ("level", "load_dependent_friction", "instant_area", 0.005, 0.33, 1, [], "",
     "the limit follows the area of every instant, N^(1 - s), so vibration's peaks of force count",
     lambda m, s: dict(area_power=s)),
    ("level", "load_dependent_friction", "saturating_area", 0.01, 0.8, 1, [(0.15, 0.5), (1.5, 4.0)], "",
     "friction higher (lower) below a load at which the contact area is full, soft edge",
     lambda m, s, fc, n: dict(mu=m.mu * (1 + s / (1 + (m.F / fc) ** n)))),
    ("shear", "contact_ageing", "stretched_bonding", 0.02, 0.98, 0, [(2e-6, 30e-6), (0.5, 1.0)], "",
     "bonds form after touch-down as a stretched exponential",
     lambda m, s, tau, n: dict(bonded=lambda time, normal, cycle: 1 - s * np.exp(-(time / tau) ** n))),
    ("shear", "contact_ageing", "log_healing", 0.004, 0.12, 0, [(1e-7, 2e-6), (50e-6, 500e-6)], "",
     "logarithmic strengthening from a cut-off time to the age at which the contact is complete",
     lambda m, s, t0, full: dict(bonded=lambda time, normal, cycle: 1 - s * np.log((full + t0) / (time + t0)))),
    ("shear", "contact_ageing", "pressed_bonding", 0.02, 0.98, 0, [(4e-6, 60e-6)], "",
     "bonds form at a rate that follows the pressure of the instant",
     lambda m, s, tau: dict(bonded=age_by_pressing(s, tau))),
    ("level", "rate_dependent_friction", "log_with_floor", 0.004, 0.4, 1, [(1 * MM, 10 * MM)], "",
     "logarithm of speed with a floor at creeping speeds",
     lambda m, s, low: dict(mu=m.mu * np.maximum(1 + s * np.log((m.U + low) / (U0 + low)), 0.1))),
    ("level", "rate_dependent_friction", "stribeck_fall", 0.01, 1.2, 0, [(8 * MM, 40 * MM), (0.6, 2.0)], "",
     "fall from boundary towards mixed friction about a Stribeck speed",
     lambda m, s, us, n: dict(mu=m.mu * (1 + s * (np.exp(-(m.U / us) ** n) - 0.4)))),
    ("level", "rate_dependent_friction", "grosch_bell", 0.01, 0.8, 1, [(8 * MM, 40 * MM), (0.5, 1.2)], "",
     "rubber-like bell over the logarithm of speed",
     lambda m, s, us, n: dict(mu=m.mu * (1 + s * (np.exp(-0.5 * (np.log(m.U / us) / n) ** 2) - 0.4)))),
    ("normal", "adhesion", "steady_pull", 3e-4, 0.3, 0, [(0.0, 0.3)], "",
     "pull-off force that grows a little with the load: s (1 + b F/0.3)",
     lambda m, s, b: dict(pull=(a := s * (1 + b * m.F / F0)), more=lambda normal: a[:, None])),
    ("normal", "adhesion", "jkr_pull", 1e-5, 0.1, 0, [], "",
     "JKR: friction follows N + P + sqrt(2 P N + P^2), pull-off at P/2",
     lambda m, s: dict(pull=0.5 * s + 0 * m.F,
                       more=lambda normal: s + np.sqrt(np.maximum(2 * s * normal + s ** 2, 0)))),
    ("normal", "adhesion", "meniscus_pull", 5e-4, 0.4, 0, [(40.0, 55.0), (3.0, 10.0)], "humidity",
     "water menisci pull above a humidity, soft edge",
     lambda m, s, h, n: dict(pull=(a := s / (1 + np.exp(-(m.H - h) / n))), more=lambda normal: a[:, None])),
    ("level", "moisture_drift", "uptake_and_drying", 0.01, 0.8, 1, [(100, 800), (200, 3000)], "time",
     "exponential uptake within a run, drying in the pauses",
     lambda m, s, rise, fall: dict(mu=m.mu * (1 + s * soaked(m, rise, fall)))),
    ("level", "moisture_drift", "sweat_onset", 0.01, 0.8, 1, [(0.2, 0.7), (0.03, 0.15)], "time",
     "sweat sets in at a share of the session, soft edge",
     lambda m, s, mid, n: dict(mu=m.mu * (1 + s / (1 + np.exp(-(m.t / m.t[-1] - mid) / n))))),
    ("level", "moisture_drift", "humid_soak", 0.01, 0.8, 1, [(150, 1200)], "time humidity",
     "uptake within a run in proportion to the humidity of the air",
     lambda m, s, rise: dict(mu=m.mu * (1 + s * soaked(m, rise, 1500) * np.clip((m.H - 20) / 35, 0.05, 1.6)))),
    ("normal", "multi_asperity", "gaussian_heights", 1e-8, 2e-6, 0, [(0.0, 0.3)], "",
     "normal heights (rms s) with a skew: fewer deep valleys touch",
     lambda m, s, b: dict(heights=s * ((z := ndtri(quantiles(13))) + b * (z ** 2 - 1)))),
    ("normal", "multi_asperity", "exponential_heights", 1e-8, 2e-6, 0, [(0.8, 1.4)], "",
     "exponential (Weibull) tail of summits below the highest",
     lambda m, s, n: dict(heights=s * (-np.log(quantiles(13))) ** n)),
    ("normal", "multi_asperity", "crest_and_flank", 3e-8, 3e-6, 0, [(0.2, 0.6), (0.1, 0.4)], "",
     "crests of the ridges touch first, flanks lie s deeper, both a little blurred",
     lambda m, s, b, n: dict(heights=s * ((quantiles(13) > b) + n * ndtri(quantiles(13)[7 * np.arange(13) % 13])))),
    ("stiffness", "subsurface_relaxation", "two_time_creep", 0.02, 1.2, 1, [(10, 60), (200, 1500), (0.5, 1.3)], "time",
     "both stiffnesses creep with a quick and a slow time; the lateral one by another power",
     lambda m, s, t1, t2, b: stiffen(m, c := s * (1 - 0.4 * np.exp(-m.t / t1) - 0.6 * np.exp(-m.t / t2)), b * c)),
    ("stiffness", "subsurface_relaxation", "log_creep", 0.02, 1.2, 1, [(2, 30)], "time runs",
     "logarithmic creep that starts again after each pause",
     lambda m, s, t0: stiffen(m, c := s * np.log1p(m.rt / t0) / np.log1p(300 / t0), c)),
    ("stiffness", "subsurface_relaxation", "load_dose", 0.02, 1.5, 1, [(0.15, 0.6)], "time",
     "stiffness changes with the sum of load times time so far, saturating",
     lambda m, s, n: stiffen(m, c := s * (1 - np.exp(-np.cumsum(m.F) / (n * m.F.sum()))), c)),
    ("stiffness", "stiffness_error", "wrong_normal", 0.2, 1.8, 1, [], "", "normal stiffness off by exp(s)",
     lambda m, s: stiffen(m, s, 0)),
    ("stiffness", "stiffness_error", "wrong_lateral", 0.2, 1.8, 1, [], "", "lateral stiffness off by exp(s)",
     lambda m, s: stiffen(m, 0, s)),
    ("stiffness", "stiffness_error", "wrong_both", 0.2, 1.8, 1, [(0.4, 1.0)], "",
     "both off, as with a contact area misjudged; the lateral one by a weaker power",
     lambda m, s, b: stiffen(m, s, b * s)),
    ("stiffness", "stiffness_error", "static_calibration", 0.2, 1.8, 1, [(0.1, 0.6)], "",
     "calibrated at rest: off by exp(s), and stiffer with frequency by a weak power",
     lambda m, s, n: stiffen(m, c := s + n * abs(s) * np.log(m.f / KHZ30), c)),
    ("stiffness", "stiffness_error", "one_load_calibration", 0.2, 1.8, 1, [(0.1, 0.6)], "",
     "calibrated by pressing at one light load: off by exp(s), and stiffer with load by a weak power",
     lambda m, s, n: stiffen(m, c := s + n * abs(s) * np.log(m.F / F0), c)),
    ("plate", "amplitude_miscalibration", "roll_off_gain", 0.01, 0.8, 1, [(-1.0, 2.0)], "frequencies",
     "vibrometer's gain error, which follows frequency by a power",
     lambda m, s, n: dict(w=m.w * np.maximum(1 + s * (m.f / KHZ30) ** n, 0.1))),
    ("plate", "amplitude_miscalibration", "soft_dead_zone", 1e-8, 1.2e-6, 0, [], "",
     "dead zone with a soft edge: sqrt(w^2 + s^2) - s",
     lambda m, s: dict(w=np.hypot(m.w, s) - s)),
    ("plate", "amplitude_miscalibration", "bent_gain", 0.01, 0.8, 1, [(0.1, 0.5)], "",
     "gain error that shrinks towards large amplitude: 1 + s (1 - b w/2 um)",
     lambda m, s, b: dict(w=m.w * (1 + s * (1 - b * m.w / (2 * UM))))),
    ("plate", "amplitude_droop", "source_resistance", 0.01, 8.0, 0, [(0.6, 1.0)], "",
     "w/(1 + s F^n): source resistance against the finger's damping",
     lambda m, s, n: dict(w=m.w / (1 + s * m.F ** n))),
    ("plate", "amplitude_droop", "reactive_load", 0.02, 10.0, 0, [(0.1, 0.6)], "",
     "the finger as resistance and reactance, the latter grows with frequency",
     lambda m, s, b: dict(w=m.w / np.hypot(1 + b * s * m.F, s * m.F * m.f / KHZ30))),
    ("plate", "amplitude_droop", "sagging_supply", 0.01, 6.0, 0, [(1 * UM, 4 * UM)], "",
     "droop in proportion to load, worse at large amplitude as the supply sags",
     lambda m, s, wc: dict(w=m.w / (1 + s * m.F * (1 + m.w / wc)))),
    ("plate", "amplitude_saturation", "rapp_knee", 0.3, 6.0, 0, [(1.2, 5.0)], "",
     "Rapp's amplifier curve with the ceiling 2 um/s and a knee of given sharpness",
     lambda m, s, n: dict(w=m.w / (1 + (m.w * s / (2 * UM)) ** (2 * n)) ** (0.5 / n))),
    ("plate", "amplitude_saturation", "current_limit", 0.3, 6.0, 0, [(1.2, 4.0), (0.8, 2.0)], "",
     "the same where the ceiling falls with frequency (current or slew limit)",
     lambda m, s, n, k: dict(w=m.w / (1 + (m.w * s / (2 * UM) * (m.f / KHZ30) ** k) ** (2 * n)) ** (0.5 / n))),
    ("plate", "amplitude_saturation", "compressed_above", 0.5, 8.0, 0, [(0.0, 0.5), (0.05 * UM, 0.3 * UM)], "",
     "above the knee at 2 um/s the amplitude follows with a smaller slope, soft edge",
     lambda m, s, b, n: dict(w=np.maximum(m.w - (1 - b) * n * (np.logaddexp(0, (m.w - (k := 2 * UM / s)) / n)
                                                               - np.logaddexp(0, -k / n)), 0))),
    ("plate", "resonance_detuning", "warmed_plate", 1e-5, 4e-3, 0, [(60, 400), (0.0, 0.4)], "temperature",
     "resonance sinks by the share s per kelvin from the first pass (quality factor, detuning at the start)",
     lambda m, s, quality, x0: off_peak(m, x0 + 2 * quality * s * (m.T - m.T[0]))),
    ("plate", "resonance_detuning", "missed_peak", 3.0, 400.0, 0, [(-0.008, 0.008)], "narrow",
     "one resonance near the frequencies of the table; s is its quality factor, shape its place",
     lambda m, s, off: off_peak(m, 2 * s * (m.f / np.median(m.f) - 1 - off))),
    ("plate", "resonance_detuning", "softening_peak", 3.0, 400.0, 0, [(-0.004, 0.008), (0.001, 0.008)], "narrow",
     "the same where the resonance sinks with the square of the amplitude (piezo softening)",
     lambda m, s, off, b: off_peak(m, 2 * s * (m.f / np.median(m.f) - 1 - off + b * (m.w / (2 * UM)) ** 2))),
    ("plate", "mode_shape", "standing_wave", 0.02, 0.97, 0, [(8 * MM, 25 * MM), (-10 * MM, 10 * MM)], "position",
     "antinodes and nodes half a wave apart; nodes are not quite at rest",
     lambda m, s, wave, x0: dict(w=m.w * np.sqrt(1 - s * np.sin(np.pi * (m.x - x0) / wave) ** 2))),
    ("plate", "mode_shape", "clamped_edge", 0.02, 0.95, 0, [(-6 * MM, 6 * MM), (1.5, 4.0)], "position",
     "amplitude falls from an antinode towards clamped edges by a power of the distance",
     lambda m, s, x0, n: dict(w=m.w * np.maximum(1 - s * abs((m.x - x0) / 0.02) ** n, 0.05))),
    ("plate", "mode_shape", "bending_wave", 0.02, 0.95, 0, [(9 * MM, 22 * MM), (-10 * MM, 10 * MM)], "position",
     "bending wave over a common motion; its nodes move closer with the root of frequency",
     lambda m, s, wave, x0: dict(w=m.w * (1 - s + s * abs(np.cos(np.pi * (m.x - x0) / wave
                                                                  * np.sqrt(m.f / KHZ30)))))),
    ("readout", "force_crosstalk", "lever_arm", 5e-4, 0.25, 1, [(15 * MM, 60 * MM)], "position",
     "share of the normal force in the lateral reading, growing with the distance from the sensor's axis",
     lambda m, s, xc: read(m, lambda l, n: s * n * (1 + m.x / xc))),
    ("readout", "force_crosstalk", "bent_axis", 5e-4, 0.25, 1, [(0.8, 4.0)], "",
     "share of the normal force that grows as the sensor bends under it",
     lambda m, s, nc: read(m, lambda l, n: s * n * (1 + n / nc))),
    ("readout", "force_crosstalk", "into_normal", 5e-3, 0.4, 1, [(0.0, 0.5)], "",
     "the reverse: a share of the signed lateral force is read as normal force, a smaller one (by b) at large force",
     lambda m, s, b: read(m, None, lambda l, n: s * l * (1 + b * (l / F0) ** 2) / (1 + (l / F0) ** 2))),
    ("readout", "lateral_offset_drift", "warming_bridge", 3e-4, 0.15, 1, [(200, 1500), (0.0, 0.9)], "time",
     "zero error that starts at a share and settles exponentially as the bridge warms",
     lambda m, s, tau, b: read(m, lambda l, n: s * (1 - (1 - b) * np.exp(-m.t / tau)))),
    ("readout", "lateral_offset_drift", "tare_creep", 3e-4, 0.15, 1, [(0.4, 1.0)], "time runs",
     "tared before each run, then creeping by a power of the time in the run",
     lambda m, s, n: read(m, lambda l, nf: s * (m.rt / 300) ** n)),
    ("readout", "lateral_offset_drift", "thermal_zero", 2e-4, 0.08, 1, [(-1.0, 1.0)], "temperature time",
     "zero error in proportion to the warming, and a constant part",
     lambda m, s, b: read(m, lambda l, n: s * (b + m.T - m.T[0]))),
    ("readout", "normal_offset", "creeping_tare", 1e-3, 0.06, 1, [(0.0, 0.8)], "time",
     "constant offset of the normal force that grows in the course of the session",
     lambda m, s, b: read(m, None, lambda l, n: s * (1 + b * m.t / m.t[-1]) / (1 + b))),
    ("readout", "normal_offset", "run_tare", 1e-3, 0.06, 1, [(0.0, TAU), (0.0, 0.5)], "runs",
     "another zero error of the normal force in every run, about a common one",
     lambda m, s, phase, b: read(m, None, lambda l, n: s * (b + np.cos(phase + 2.4 * m.run)) / (1 + b))),
    ("readout", "normal_offset", "fixed_tare", 1e-3, 0.06, 1, [], "", "constant offset of the normal force",
     lambda m, s: read(m, None, lambda l, n: s + 0 * n)),
    ("readout", "plate_tilt", "fixed_slope", 5e-4, 0.25, 1, [], "", "axes turned by a fixed angle",
     lambda m, s: tilt(m, s)),
    ("readout", "plate_tilt", "bowed_plate", 5e-4, 0.2, 1, [(12 * MM, 50 * MM)], "position",
     "angle that changes along a bowed plate: s (1 + x/xc)", lambda m, s, xc: tilt(m, s * (1 + m.x / xc))),
    ("readout", "plate_tilt", "yielding_mount", 5e-4, 0.15, 1, [(0.4, 3.0)], "",
     "angle that grows as the mount yields under the load: s (1 + F/Fc)", lambda m, s, fc: tilt(m, s * (1 + m.F / fc))),
    ("speed", "speed_error", "belt_factor", 0.01, 0.9, 1, [(-0.5, 0.6)], "",
     "factor error that follows speed by a power", lambda m, s, n: pace(m, m.U * (1 + s * (m.U / 0.03) ** n))),
    ("speed", "speed_error", "creeping_stage", 5e-5, 2e-2, 1, [(20 * MM, 100 * MM)], "",
     "constant speed added (or lost), which fades at high speed",
     lambda m, s, uc: pace(m, m.U + s * np.exp(-m.U / uc))),
    ("speed", "speed_error", "motor_slip", 0.01, 4.0, 0, [(10 * MM, 80 * MM), (0.5, 2.0)], "",
     "slip beyond a speed, soft edge", lambda m, s, uc, n: dict(U=m.U / (1 + s * (r := (m.U / uc) ** n) / (1 + r)))),
    ("speed", "speed_ripple", "pitch_ripple", 0.02, 1.2, 0, [(1.5 * MM, 6 * MM), (0, TAU), (20 * MM, 100 * MM)],
     "position", "ripple with the screw's pitch that the stage's mass smooths at high speed",
     lambda m, s, pitch, phase, uc: pace(m, m.U * (1 + s * np.sin(TAU * m.x / pitch + phase) / (1 + m.U / uc)))),
    ("speed", "speed_ripple", "two_starts", 0.02, 0.8, 0, [(1.5 * MM, 6 * MM), (0, TAU), (0.2, 0.6)], "position",
     "ripple with the pitch and its half, as from a nut that rocks",
     lambda m, s, pitch, phase, b: pace(m, m.U * (1 + s * (np.sin(z := TAU * m.x / pitch + phase)
                                                           + b * np.sin(2 * z + 1.0))))),
    ("speed", "speed_ripple", "cogging", 1e-4, 4e-2, 0, [(1.5 * MM, 6 * MM), (0, TAU)], "position",
     "ripple of a given speed rather than share, as from motor cogging",
     lambda m, s, pitch, phase: pace(m, m.U + s * np.sin(TAU * m.x / pitch + phase) / (1 + m.U / 0.05))),
]
FORMS = [SimpleNamespace(**dict(zip("part cause name low high signed shapes needs meaning law".split(), row)))
         for row in FORM_TABLE]
ORDER = ("plate", "speed", "stiffness", "level", "normal", "shear", "ridge", "readout")
CAUSES = sorted({form.cause for form in FORMS})


# ---------------------------------------------------------------------------------------------------------------------
# Strangers: structure that no mechanism of the list makes; laws give the factor of the friction coefficient less one

def rough_curve(z, mark):
    """A jagged but repeatable function of z (a few octaves), numbered by `mark`; rms about one."""
    rng = np.random.default_rng(int(mark))
    rates, phases = 2 ** rng.uniform(2.0, 4.5, 9), rng.uniform(0, TAU, 9)
    return np.sin(z[:, None] * rates + phases).sum(axis=1) * np.sqrt(2 / 9)


def last(values):
    """Value of the previous pass (its own for the first)."""
    return np.r_[values[:1], values[:-1]]


STRANGER_TABLE = [
    ("speed_switch", "jump", "speed_m_s", 0.005, 0.8, [(0.35, 0.65)], "fill",
     "friction jumps at a speed (quantile of the table)", lambda m, s, q: s * (m.U > np.quantile(m.U, q))),
    ("melting_sebum", "jump", "temperature_c", 0.005, 0.8, [(0.3, 0.7)], "temperature",
     "friction jumps at a temperature", lambda m, s, q: s * (m.T > np.quantile(m.T, q))),
    ("humid_window", "bump", HUMIDITY, 0.005, 1.2, [(0.3, 0.7), (1.0, 4.0)], "humidity",
     "narrow bump over humidity", lambda m, s, q, n: s * np.exp(-0.5 * ((m.H - np.quantile(m.H, q)) / n) ** 2)),
    ("load_window", "bump", "normal_force_n", 0.005, 1.2, [(0.25, 0.75), (0.08, 0.2)], "fill",
     "narrow bump over the logarithm of load",
     lambda m, s, q, n: s * np.exp(-0.5 * (np.log(m.F / np.quantile(m.F, q)) / n) ** 2)),
    ("woven_coating", "period", "position_m", 0.005, 0.7, [(1.5 * MM, 7 * MM), (0, TAU)], "position",
     "period along the plate, still or not", lambda m, s, wave, phase: s * np.sin(TAU * m.x / wave + phase)),
    ("cooling_cycle", "period", "time_s", 0.005, 0.7, [(0.08, 0.2), (0, TAU)], "time",
     "period in time (share of the session)", lambda m, s, n, phase: s * np.sin(TAU * m.t / m.t[-1] / n + phase)),
    ("nail_resonance", "resonance", "frequency_hz", 0.005, 0.9, [(0.3, 0.7), (0.01, 0.04)], "fill frequencies",
     "a finger resonance turns friction up on one side and down on the other (dispersive line), when vibrated",
     lambda m, s, q, n: s * (m.w > 0) * 2 * (z := (m.f / np.quantile(m.f, q) - 1) / n) / (1 + z ** 2)),
    ("jagged_load", "rough", "normal_force_n", 0.003, 0.4, [(0, 9999)], "fill",
     "a jagged, repeatable function of load", lambda m, s, mark: s * rough_curve(np.log(m.F), mark)),
    ("memory_of_load", "memory", "normal_force_n", 0.003, 0.4, [], "",
     "the previous pass's load is remembered", lambda m, s: s * np.log(last(m.F) / F0)),
    ("polish_of_amplitude", "memory", "amplitude_pp_m", 0.003, 0.4, [(0.4, 1.5)], "",
     "the previous pass's amplitude leaves the surface changed", lambda m, s, n: s * (last(m.w) / (2 * UM)) ** n),
]
STRANGERS = [SimpleNamespace(part="stranger", cause="outside the library", signed=1, **dict(zip(
    "name structure covariate low high shapes needs meaning law".split(), row))) for row in STRANGER_TABLE]


# ---------------------------------------------------------------------------------------------------------------------
# A model of a table: conditions, finger, and the forms that act

def simulate(plan, finger, acting):
    """Noise-free signed lateral force and normal reading; `acting` is a list of (form, size, shapes)."""
    m = SimpleNamespace(**{name: getattr(plan, name) for name in "w f U F way x t rt run T H p".split()})
    one = np.ones_like(m.F)
    m.kn, m.kl, m.mu, m.borne, m.area_power, m.read = finger.kn * one, finger.kl * one, finger.mu * one, one, 0.0, []
    m.heights = m.loss = m.rebound = m.pull = m.more = m.kept = m.bonded = m.ridge = None
    for part in ORDER:
        for form, size, shapes in acting:
            if form.part == part:
                m.__dict__.update(form.law(m, size, *shapes))
    for form, size, shapes in acting:
        if form.part == "stranger":
            m.mu = m.mu * np.maximum(1 + form.law(m, size, *shapes), 0.05)
    lateral, normal = m.way * friction(m), m.F
    more = [law(lateral, normal) for law in m.read]
    return lateral + sum(d[0] for d in more), np.maximum(normal + sum(d[1] for d in more), 0.02) + 0.0


def baseline(plan, normal, rows, log_kn, log_kl, log_mu):
    """Signed friction of the spring-slider at the normal reading; parameters may be arrays (one block each)."""
    count, blocks = int(rows.sum()), len(log_kn)
    model = SimpleNamespace(heights=None, loss=None, rebound=None, pull=None, kept=None, bonded=None, ridge=None,
                            area_power=0.0, borne=1.0)
    model.w, model.f, model.U, model.F = (np.tile(v[rows], blocks) for v in (plan.w, plan.f, plan.U, normal))
    model.kn, model.kl, model.mu = (np.repeat(np.exp(v), count) for v in (log_kn, log_kl, log_mu))
    return friction(model).reshape(blocks, count) * plan.way[rows]


def stated_sd(rig, lateral, normal):
    """Standard deviation that rig.toml states for a lateral force, that of the normal reading included."""
    return np.sqrt((rig.r * lateral) ** 2 + rig.q ** 2 * (1 + (lateral / normal) ** 2))


def recalibrate(plan, rig, lateral, normal):
    """Fits ln kn, ln kl, ln mu0 under their priors (damped Gauss-Newton); returns chi2 of the data, forces of all.

    Where the fit from the nominal values is poor, a second one starts from the best of a coarse lattice."""
    train, still = ~plan.hidden, ~plan.hidden & (plan.w == 0)
    guess = (plan.way * lateral * normal)[still].sum() / (normal[still] ** 2).sum()
    centre = np.array([np.log(rig.kn), np.log(rig.kl), np.log(max(guess, 0.02))])
    spread, sd, step = np.array([0.05, 0.05, 0.3]), stated_sd(rig, lateral, normal)[train], 1e-3
    offsets = np.vstack([np.zeros(3), step * np.eye(3)])

    def rests(points):
        return (lateral[train] - baseline(plan, normal, train, *points.T)) / sd

    def costs(points, rest):
        return (rest ** 2).sum(axis=1) + (((points - centre) / spread) ** 2).sum(axis=1)

    def fit(point):
        blocks, damping = rests(point + offsets), 1e-4
        cost = costs(point[None], blocks[:1])[0]
        for _ in range(40):
            slope = (blocks[0] - blocks[1:]) / step
            matrix = slope @ slope.T + np.diag(spread ** -2)
            pull = slope @ blocks[0] - (point - centre) / spread ** 2
            move = np.linalg.solve(matrix + damping * np.diag(np.diag(matrix)), pull)
            trial = point + move * min(1.0, 0.5 / np.abs(move).max())
            new = rests(trial + offsets)
            gain = cost - costs(trial[None], new[:1])[0]
            if gain > 0:
                point, blocks, cost, damping = trial, new, cost - gain, damping * 0.1
            else:
                damping = max(damping, 1e-4) * 10
            if abs(gain) < 1e-3 + 1e-4 * cost or damping > 1e6:
                break
        return cost, float(blocks[0] @ blocks[0]), point

    best = fit(centre)
    if best[1] > 2 * train.sum():
        shifts = np.array([-1.8, -1.1, -0.5, 0.0, 0.5, 1.1, 1.8])
        lattice = centre + np.stack(np.meshgrid(shifts, shifts, [0.0]), axis=-1).reshape(-1, 3)
        best = min(best, fit(lattice[np.argmin(costs(lattice, rests(lattice)))]), key=lambda found: found[0])
    return best[1], baseline(plan, normal, np.ones_like(train), *best[2][:, None])[0]


# ---------------------------------------------------------------------------------------------------------------------
# Designs

def settings(rng, kind, narrow, many):
    """Amplitude, load, speed and frequency of all passes, in no order."""
    w_lo, w_hi = rng.uniform(0.25, 0.5) * UM, rng.uniform(2.0, 3.5) * UM
    low = np.array([w_lo, rng.uniform(0.1, 0.15), rng.uniform(5, 9) * MM])
    high = np.array([w_hi, rng.uniform(0.6, 1.0), rng.uniform(40, 80) * MM])
    middle = rng.uniform(25e3, 34e3)
    band = middle * (1 + np.array([-1, 1]) * rng.uniform(0.006, 0.014)) if narrow else \
        np.array([rng.uniform(23e3, 26e3), rng.uniform(31e3, 36e3)])
    count = int(rng.integers(3, 6)) if narrow or many else int(rng.choice([1, 2, 3, 4]))
    tones = np.round(np.linspace(*band, count) if count > 1 else [middle])
    total = int(rng.integers(90, 191))
    if kind == "grid":
        while True:
            n = [int(rng.integers(4, 6)), int(rng.integers(3, 5)), int(rng.integers(3, 6)), min(count, 3)]
            if 90 <= (n[0] + 1) * n[1] * n[2] * n[3] <= 190:
                break
            count = max(1, count - 1) if not narrow else count
            n[3] = min(count, 3)
        levels = [np.geomspace(a, b, k) for a, b, k in zip(low, high, n)]
        levels[0] = np.r_[0, levels[0]]
        mesh = np.meshgrid(*levels, tones[np.linspace(0, len(tones) - 1, n[3]).round().astype(int)], indexing="ij")
        return np.stack([v.ravel() for v in mesh])
    if kind == "filling":
        unit = qmc.LatinHypercube(4, seed=rng).random(total).T
        cast = low[:, None] * (high / low)[:, None] ** unit[:3]
        tone = np.round(band[0] + unit[3] * (band[1] - band[0])) if count > 1 and (many or rng.random() < 0.5) else \
            tones[(unit[3] * len(tones)).astype(int)]
        cast[0][rng.permutation(total)[:round(0.18 * total)]] = 0
        return np.vstack([cast, tone])
    points = []                                       # sweeps of one setting at a time about two or three centres
    for _ in range(int(rng.integers(2, 4))):
        centre = np.r_[low * (high / low) ** rng.uniform([0.3, 0.15, 0.15], [0.8, 0.85, 0.85]), rng.choice(tones)]
        for which in range(3):
            for value in np.geomspace(low[which], high[which], int(rng.integers(9, 13))):
                points.append(np.where(np.arange(4) == which, value, centre))
        points += [np.r_[centre[:3], tone] for tone in tones]
        points += [np.r_[0, centre[1], value, centre[3]] for value in np.geomspace(low[2], high[2], 5)]
        points += [np.r_[0, value, centre[2], centre[3]] for value in np.geomspace(low[1], high[1], 4)]
    points = np.array(points)
    return np.vstack([points, points[rng.permutation(len(points))[:max(0, total - len(points))]]]).T[:, :190]


def corner(rng, plan):
    """Mask of a region of extremes of two settings with 5 to 25 % of the passes, or None."""
    axes = ["w", "F", "U"] + ["f"] * (len(np.unique(plan.f)) >= 3)
    for _ in range(80):
        mask = np.ones(len(plan.w), bool)
        for name in rng.choice(axes, 2, replace=False):
            value, share = getattr(plan, name), rng.uniform(0.15, 0.5)
            upper = name == "w" or rng.random() < 0.5
            mask &= value >= np.quantile(value, 1 - share) if upper else value <= np.quantile(value, share)
        if 0.05 <= mask.mean() <= 0.25:
            return mask
    return None


def draw_plan(rng, needs):
    """A table's conditions in order of time, its hidden passes and the columns that it shows."""
    while True:
        kind = "filling" if "fill" in needs else str(rng.choice(["grid", "filling", "sweeps"]))
        cast = settings(rng, kind, "narrow" in needs or rng.random() < 0.12, "frequencies" in needs)
        n = cast.shape[1]
        cast = cast[:, rng.permutation(n)]
        plan = SimpleNamespace(kind=kind, w=cast[0], U=cast[2], f=cast[3])
        plan.F = np.round(cast[1] * (1 + 0.02 * rng.standard_normal(n)), 6)
        plan.region = corner(rng, plan)
        if plan.region is None:
            continue
        plan.hidden = plan.region.copy()
        others = rng.permutation(np.flatnonzero(~plan.region))
        plan.hidden[others[:round(len(others) / 6)]] = True
        still, train = plan.w == 0, ~plan.hidden
        if 60 <= train.sum() <= 140 and (still & train).sum() >= 6 and 0.12 <= still.mean() <= 0.24:
            break
    plan.w, plan.U = (np.array([float(f"{v:.6e}") for v in values]) for values in (plan.w, plan.U))
    plan.way = np.where(rng.permutation(n) % 2, 1, -1) if rng.random() < 0.7 else np.where(np.arange(n) % 2, 1, -1)
    runs = int(rng.integers(3, 9)) if "runs" in needs else int(rng.integers(1, 9))
    plan.run = np.arange(n) * runs // n
    first = np.r_[True, np.diff(plan.run) > 0]
    waits = rng.uniform(6, 12) * (1 + 0.08 * rng.standard_normal(n)) + first * rng.uniform(200, 2400, n)
    waits[0] = rng.uniform(0.5, 5)
    plan.t = np.round(np.cumsum(waits), 3)
    plan.rt = plan.t - plan.t[first][plan.run]
    plan.x = np.round(rng.uniform(-0.0185, 0.0185, n), 5)
    warm = rng.uniform(2, 8) if "temperature" in needs else rng.choice([0.1, rng.uniform(0.5, 8)])
    warming = soaked(plan, rng.uniform(150, 700), rng.uniform(400, 3000)) + 0.2 * plan.t / plan.t[-1]
    plan.T = np.round(rng.uniform(20, 25) + warm * warming + 0.02 * rng.standard_normal(n), 3)
    swing = rng.uniform(10, 18) if "humidity" in needs else rng.choice([1.0, rng.uniform(3, 18)])
    cycle = TAU * plan.t / plan.t[-1] * rng.uniform(0.6, 2.2) + rng.uniform(0, TAU)
    plan.H = np.round(np.clip(rng.uniform(40, 52) + swing * np.sin(cycle) + 0.4 * rng.standard_normal(n), 12, 92), 2)
    levels = rng.random() < 0.3
    plan.p = np.where(levels & (rng.random(n) < 0.3), 20000.0, P0)
    shown = {name for name, odds in (("position", 0.6), ("temperature", 0.5), ("humidity", 0.4),
                                     ("runs", 0.6 * (runs > 1))) if name in needs or rng.random() < odds}
    plan.shown = shown | ({"pressure"} if levels or rng.random() < 0.2 else set())
    plan.runs = runs
    return plan


NOISES = {"gaussian": 0.35, "heavy_tails": 0.13, "lasting": 0.13, "outliers": 0.13, "run_shifts": 0.13,
          "grows_with_speed": 0.13}


def disturb(rng, plan, rig, kind, lateral, normal):
    """Measured forces: the true readings with noise of the given kind."""
    n = len(lateral)
    share, force = rng.standard_normal(n), rng.standard_normal(n)
    if kind == "heavy_tails":
        share, force = rng.standard_t(3, n) / np.sqrt(3), rng.standard_t(3, n) / np.sqrt(3)
    elif kind == "lasting":
        rho = rng.uniform(0.6, 0.9)
        for i in range(1, n):
            share[i] = rho * share[i - 1] + np.sqrt(1 - rho ** 2) * share[i]
    elif kind == "run_shifts":
        share = share + 2.5 * rng.standard_normal(plan.runs)[plan.run]
    elif kind == "grows_with_speed":
        growth = plan.U ** rng.uniform(0.4, 0.9)
        share = share * growth / np.sqrt((growth ** 2).mean())
    out = lateral * (1 + rig.r * share) + rig.q * force
    if kind == "outliers":
        bad = rng.permutation(np.flatnonzero(~plan.hidden))[:max(1, round(0.02 * n))]
        kick = rng.choice([-1, 1], len(bad)) * rng.uniform(8, 25, len(bad))
        out[bad] += kick * stated_sd(rig, lateral, normal)[bad]
    return out, np.maximum(normal + rig.q * rng.standard_normal(n), 0.002)


# ---------------------------------------------------------------------------------------------------------------------
# One set

def short(value):
    """Six significant digits."""
    return float(f"{value:.6g}")


def choose_size(form, sign, target, chi2_of, other_way=True):
    """Size whose chi2 meets the target: a ladder upwards, then interpolation; the most visible where none does.

    Where one sign can hardly be seen at all, the other is taken."""
    ladder = np.geomspace(form.low, form.high, 6 if form.part == "ridge" else 9)
    below, best = None, (0.0, ladder[0])
    for size in ladder:
        chi2 = max(chi2_of(sign * size), 1e-9)
        best = max(best, (chi2, size))
        if chi2 >= target:
            break
        below = (np.log(size), np.log(chi2))
    else:
        if form.signed and best[0] < 30 and other_way:
            return choose_size(form, -sign, target, chi2_of, other_way=False)
        return sign * best[1]
    if below is None:
        return sign * ladder[0]
    above = (np.log(size), np.log(chi2))
    for _ in range(5):
        part = np.clip((np.log(target) - below[1]) / (above[1] - below[1]), 0.1, 0.9)
        middle = below[0] + part * (above[0] - below[0])
        value = np.log(max(chi2_of(sign * np.exp(middle)), 1e-9))
        if abs(value - np.log(target)) < 0.05:
            return sign * np.exp(middle)
        below, above = ((middle, value), above) if value < np.log(target) else (below, (middle, value))
    return sign * np.exp(0.5 * (below[0] + above[0]))


def draw_forms(rng, stratum, index):
    """The forms that act in a set, without their sizes."""
    if stratum == "none":
        return []
    if stratum == "stranger":
        return [STRANGERS[index % len(STRANGERS)]]
    if stratum == "single":
        wanted = [CAUSES[index % len(CAUSES)]]
        return [rng.choice([form for form in FORMS if form.cause == wanted[0]])]
    while True:
        pair = [rng.choice([form for form in FORMS if form.cause == cause])
                for cause in rng.choice(CAUSES, 2, replace=False)]
        if "ridge" not in (parts := {form.part for form in pair}) and len(parts) == 2:
            return sorted(pair, key=lambda form: form.cause)


def draw_set(seed, stratum, index):
    """Everything about one set: plan, rig, readings and truth."""
    rng = np.random.default_rng([seed, STRATA.index(stratum), index])
    forms = draw_forms(rng, stratum, index)
    noise = str(rng.choice(list(NOISES), p=list(NOISES.values())))
    needs = {need for form in forms for need in form.needs.split()} | ({"runs"} if noise == "run_shifts" else set())
    plan = draw_plan(rng, needs)
    rig = SimpleNamespace(kn=short(np.exp(rng.uniform(np.log(1.5e6), np.log(6e6)))),
                          r=round(rng.uniform(0.006, 0.02), 5), q=round(np.exp(rng.uniform(*np.log([3e-4, 1e-3]))), 6))
    rig.kl = short(rig.kn * rng.uniform(0.25, 0.6))
    finger = SimpleNamespace(kn=rig.kn * np.exp(0.05 * rng.standard_normal()), mu=short(rng.uniform(0.25, 0.9)),
                             kl=rig.kl * np.exp(0.05 * rng.standard_normal()))
    acting, alone, count = [], [], (~plan.hidden).sum()
    for form in forms:
        shapes = [short(rng.uniform(*bounds)) for bounds in form.shapes]
        sign = int(rng.choice([-1, 1])) if form.signed else 1
        target = count * np.exp(2 * rng.uniform(np.log(0.7), np.log(10)))
        chi2_of = lambda size: recalibrate(plan, rig, *simulate(plan, finger, [(form, size, shapes)]))[0]
        size = short(choose_size(form, sign, target, chi2_of))
        acting.append((form, size, shapes))
        alone.append(chi2_of(size))
    lateral, normal = simulate(plan, finger, acting)
    chi2, fitted = recalibrate(plan, rig, lateral, normal)
    carried, sd = finger.mu * plan.F, stated_sd(rig, lateral, normal)
    error, hide = (lateral - fitted) / carried, plan.hidden
    gap, floor = (float(np.sqrt(np.mean(v[hide] ** 2))) for v in (error, sd / carried))
    strange = forms[0] if stratum == "stranger" else None
    truth = dict(cause=[form.cause for form in forms], detectable=bool(chi2 >= 30 and gap > floor),
                 chi2_over_recalibrated=chi2, gap=gap, floor=floor, stratum=stratum, alone=alone,
                 form=[form.name for form in forms], values=[[size, *shapes] for _, size, shapes in acting],
                 noise=noise, design=plan.kind, passes=int(count), mu0=finger.mu,
                 stranger=strange and dict(structure=strange.structure, covariate=strange.covariate),
                 hidden=[dict(point=int(i), lateral_force_n=short(lateral[i]), mu0_f_n=short(carried[i]),
                              in_hidden_region=bool(plan.region[i]), recalibrated_error=short(error[i]))
                         for i in np.flatnonzero(hide)],
                 noise_free=[dict(point=int(i), lateral_force_n=short(lateral[i]), normal_force_n=short(normal[i]))
                             for i in np.flatnonzero(~hide)])
    return plan, rig, disturb(rng, plan, rig, noise, lateral, normal), truth


def write_set(folder, plan, rig, measured, truth):
    """The four files of one set."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "rig.toml").write_text(
        f"[finger]\nnormal_stiffness_n_per_m = {rig.kn:.6e}\nlateral_stiffness_n_per_m = {rig.kl:.6e}\n"
        "stiffness_relative_sd = 0.05\npoisson_ratio = 0.33\n\n"
        f"[noise]\npass_relative_sd = {rig.r:.5f}\nforce_sd_n = {rig.q:.6f}\n")
    columns = [("point", "%d", np.arange(len(plan.w)), ""), ("time_s", "%.3f", plan.t, ""),
               ("amplitude_pp_m", "%.6e", plan.w, ""), ("frequency_hz", "%.1f", plan.f, ""),
               ("speed_m_s", "%.6e", plan.U, ""), ("direction", "%d", plan.way, ""),
               ("normal_force_n", "%.6f", measured[1], ""), ("lateral_force_n", "%.6f", measured[0], ""),
               ("position_m", "%.5f", plan.x, "position"), ("ambient_pressure_pa", "%d", plan.p, "pressure"),
               ("temperature_c", "%.3f", plan.T, "temperature"), (HUMIDITY, "%.2f", plan.H, "humidity"),
               ("run", "%d", plan.run, "runs")]
    columns = [column for column in columns if not column[3] or column[3] in plan.shown]
    for name, rows in (("train.csv", ~plan.hidden), ("conditions.csv", plan.hidden)):
        chosen = [c for c in columns if name == "train.csv" or c[0] != "lateral_force_n"]
        lines = [",".join(form % values[i] for _, form, values, _ in chosen) for i in np.flatnonzero(rows)]
        (folder / name).write_text("\n".join([",".join(c[0] for c in chosen), *lines]) + "\n")
    (folder / "truth.json").write_text(json.dumps(truth, indent=1) + "\n")


def folder_order(counts):
    """(stratum, index) in the order of the folders: shuffled, yet every stretch has its share of every stratum."""
    rng, keyed = np.random.default_rng(20), []
    for stratum, count in zip(STRATA, counts):
        places = (rng.permutation(count) + rng.random(count)) / max(count, 1)
        keyed += [(place, stratum, index) for index, place in enumerate(places)]
    return [(stratum, index) for _, stratum, index in sorted(keyed)]


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("out", type=Path)
    parser.add_argument("--seed", type=int, required=True)
    for name, count in (("singles", 110), ("pairs", 30), ("none", 20), ("strangers", 40)):
        parser.add_argument(f"--{name}", type=int, default=count)
    args = parser.parse_args()
    order = folder_order((args.singles, args.pairs, args.none, args.strangers))
    for number, (stratum, index) in enumerate(order):
        plan, rig, measured, truth = draw_set(args.seed, stratum, index)
        write_set(args.out / f"set-{number:03d}", plan, rig, measured, truth)
        names = " + ".join(f"{c}/{f}" for c, f in zip(truth["cause"], truth["form"])) or "-"
        print(f"set-{number:03d} {stratum:8s} {names:60s} chi2 {truth['chi2_over_recalibrated']:9.1f} gap "
              f"{truth['gap']:.4f} floor {truth['floor']:.4f} {plan.kind:8s} {truth['noise']:16s} {truth['passes']}",
              flush=True)


if __name__ == "__main__":
    main()
