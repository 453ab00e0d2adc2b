#!/usr/bin/env python3
"""Labelled tables of a finger on a vibrating plate, for `muprime diagnose`: the third generator (numpy, SciPy).

usage: third_generator.py OUT --seed S [--singles 110] [--pairs 30] [--none 20] [--strangers 40]

It shares no code with muprime, and no cause has a form of the library or of the project's own sealed sets. Each set is a
folder: train.csv, rig.toml, conditions.csv (hidden passes without lateral force) and truth.json, which only a scorer
reads. Its keys:
  cause, form; stranger: its structure and covariate; noise; design
  detectable: the noise-free gap over a recalibrated baseline has a chi2 of 30 in train.csv, and its rms on the hidden
    passes exceeds the floor, which is the stated repeatability there
  gap, floor, alone: that rms, the floor, and the chi2 of each member of a pair by itself
  noise_free: lateral and normal force of each pass of train.csv as they would be read without noise
  hidden: noise-free lateral force, full friction and the recalibrated baseline's error of each hidden pass

The contact is marched over the cycle: the plate presses the finger's spring, sliding stretches a lateral spring, and
friction limits its force. All quantities are in SI units; w is peak to peak.
"""
import argparse
import json
import pathlib
from types import SimpleNamespace

import numpy as np

STEPS = 360  # of a cycle
THETA = -np.pi + 2 * np.pi * np.arange(STEPS) / STEPS
HALF = np.linspace(1e-4, np.pi, 6000)  # half contact angles
ARC = (np.sin(HALF) - HALF * np.cos(HALF)) / np.pi  # mean of cos - cos(half) over a cycle
COLUMNS = ("w", "f", "U", "F", "dir", "x", "t", "run", "trun", "p", "T", "RH", "last")


# ---- the contact ---------------------------------------------------------------------------------------------------
def contact(d, mu, kn, kl):
    """What each pass presents to the contact, before any cause."""
    one = np.ones(len(d.w))
    return SimpleNamespace(w=d.w.copy(), f=d.f.copy(), U=d.U.copy(), F=d.F.copy(), mu=mu * one, kn=kn * one, kl=kl
                           * one,
                           heights=None, press=None, limit=None, march=None, mean=None, factor=1.0, read=[])


def one_load(depth):
    """Mean force of a spring pressed by cos(theta) + depth, and not below zero."""
    half = np.arccos(np.clip(-depth, -1, 1))
    return np.where(depth >= 1, depth, (np.sin(half) - half * np.cos(half)) / np.pi)


def bisect(low, high, over, rounds=48):
    """Root of a function that rises, for every pass at once."""
    for _ in range(rounds):
        middle = 0.5 * (low + high)
        up = over(middle) > 0
        low, high = np.where(up, low, middle), np.where(up, middle, high)
    return 0.5 * (low + high)


def pressed(c):
    """Normal forces over the cycle, one array (passes x steps) for each share of the ridges, with its weight."""
    a = np.maximum(c.w / 2, 1e-13)
    unit = c.kn * a
    if c.press is not None:
        return [(1.0, c.press(c, a))]
    if c.heights is not None:
        reach = 8 * c.heights[0][1] / a
        depth = bisect(-1 - reach, 1 + c.F / unit + reach,
                       lambda x: sum(s * one_load(x + h * k / a) for s, h, k in c.heights) - c.F / unit)
        return [(s, unit[:, None] * from_touch_down(depth + h * k / a)) for s, h, k in c.heights]
    load = c.F / unit
    return [(1.0, unit[:, None] * from_touch_down(np.where(load >= 1, load, -np.cos(np.interp(load, ARC, HALF)))))]


def turning(depth):
    """Phases over the cycle, counted from the touch-down of a spring: its stretch begins at a step."""
    return (np.pi - np.arccos(np.clip(-depth, -1, 1)))[:, None] + THETA


def from_touch_down(depth):
    """The force of a pressed spring at these phases."""
    return np.maximum(np.cos(turning(depth)) + depth[:, None], 0) * ((THETA > -np.pi) | (depth > 1)[:, None])


def ages(c, touching):
    """Time since touch-down at each step; 1 s for a contact that never ends."""
    twice = np.concatenate([touching, touching], 1)
    index = np.arange(2 * STEPS)
    since = index - np.maximum.accumulate(np.where(twice, -1, index), 1)
    return np.where(touching.all(1)[:, None], 1.0, since[:, STEPS:] / (c.f * STEPS)[:, None])


def slide(limit, drag):
    """Mean force of a spring that stretches steadily and never passes the limit."""
    ramp = drag[:, None] * np.arange(2 * STEPS)
    stretch = np.minimum.accumulate(np.concatenate([limit, limit], 1) - ramp, 1) + ramp
    return stretch[:, STEPS:].mean(1)


def marched(c, limit, drag, fall, slip, cycles=5):
    """The same step by step, for a stretch that outlasts the contact: `fall(x, dt)` recovers it in flight."""
    dt = 1 / (c.f * STEPS)
    x, before = np.zeros(len(dt)), limit[:, -1]
    for cycle in range(cycles):
        total = np.zeros(len(dt))
        for i in range(STEPS):
            top = limit[:, i]
            on, grown = top > 0, x + drag
            x = np.where(on, np.where(grown > top, np.maximum(slip(x, before, top, drag, dt), top), grown), fall(x, dt))
            total += np.where(on, np.minimum(x, top), 0.0)
            before = top
    return total / STEPS


def friction(c):
    """Mean friction (N, unsigned) of each pass."""
    if c.mean is not None:
        return c.mean(c) * c.factor
    drag = c.kl * c.U / (c.f * STEPS)
    total = 0.0
    for share, force in pressed(c):
        limit = c.mu[:, None] * force if c.limit is None else np.maximum(c.limit(c, force, ages(c, force > 0)), 0.0)
        total = total + share * (slide(limit, drag) if c.march is None else marched(c, limit, drag, *c.march))
    return total * c.factor


def bounce(c, mass, damping, square, surface, dashpot, crossley, cycles=70, averaged=24, steps=560):
    """Mean friction of ridges with mass: the finger's depth is steered until the mean load is carried."""
    a, h = np.maximum(c.w / 2, 1e-9), 1 / (c.f * steps)
    kr, ks = c.kn * surface / (surface - 1), c.kn * surface
    ratio = c.F / (c.kn * a)
    depth = a * np.where(ratio >= 1, ratio, -np.cos(np.interp(ratio, ARC, HALF)))
    y, v, stretch = np.zeros(len(a)), np.zeros(len(a)), np.zeros(len(a))
    total, carried, drag = 0.0, 0.0, c.kl * c.U * h
    for cycle in range(cycles):
        mean, touched = np.zeros(len(a)), np.zeros(len(a))
        for i in range(steps):
            phase = 2 * np.pi * i / steps
            into = a * np.sin(phase) - y
            speed = a * np.cos(phase) * (2 * np.pi * c.f) - v
            force = np.where(into > 0, np.maximum(ks * into * (1 + crossley * speed) + dashpot * speed, 0), 0.0)
            v = (v + h / mass * (force - kr * (y + depth))) / (1 + h / mass * (damping + square * np.abs(v)))
            y = y + h * v
            stretch = np.minimum(stretch + drag, c.mu * force)
            mean += force
            touched += into > 0
            if cycle >= cycles - averaged:
                total = total + stretch
        mean /= steps
        if cycle >= cycles - averaged:
            carried = carried + mean
        depth = depth + 0.3 * (c.F - mean) / (c.kn * np.maximum(touched / steps, 0.1))
    moving = total / (steps * averaged) * np.clip(c.F * averaged / np.maximum(carried, 1e-9), 0.8, 1.25)
    return np.where(c.w < 1e-12, c.mu * c.F, moving)


def evaluate(d, act, values, mu, kn, kl):
    """Lateral and normal force as the sensor reads them, without noise."""
    c = contact(d, mu, kn, kl)
    if act is not None:
        act(c, d, *values)
    lateral, normal = d.dir * friction(c), d.F.copy()
    for read in c.read:
        lateral, normal = read(lateral, normal)
    return lateral, normal


# ---- the causes, in forms of their own -------------------------------------------------------------------------------
CAUSES, STRANGERS = {}, {}


def cause(name, low, high, needs="", signed=False, **shapes):
    """Registers a form of a cause: sizes from low to high, shapes uniform in their ranges."""
    def add(act):
        CAUSES.setdefault(name, []).append(SimpleNamespace(
            name=name, act=act, low=low, high=high, needs=needs, signed=signed, shapes=shapes, form=act.__name__))
        return act
    return add


def stranger(name, structure, covariate, low, high, needs="", signed=True, **shapes):
    """Registers a structure that no cause of the library makes."""
    def add(act):
        STRANGERS[name] = SimpleNamespace(name=name, act=act, low=low, high=high, needs=needs, signed=signed,
                                          shapes=shapes,
                                          form=name, structure=structure, covariate=covariate)
        return act
    return add


@cause("squeeze_film", 0.01, 2.0, wc=(0.8e-6, 3e-6))
def film_that_carries_a_largest_force(c, d, s, wc):
    film = s * d.p / 101325 * c.w**2 / (c.w**2 + (wc * d.f_ref / c.f) ** 2)
    c.F = c.F / (1 + (film / c.F) ** 2) ** 0.5


@cause("squeeze_film", 0.02, 0.95, w0=(0.8, 2.0), width=(0.15, 0.35))
def film_with_an_onset(c, d, s, w0, width):
    onset = 1 / (1 + np.exp(-np.log(np.maximum(c.w, 1e-9) / (w0 * 1e-6)) / width))
    c.F = c.F * (1 - s * onset * np.minimum(d.p / 101325, 1))


@cause("lateral_recovery", 2e-8, 1e-4, power=(1.15, 1.6))
def faster_the_further(c, d, tau, power):
    # Kinetics of a higher order: the rate grows as a power of the stretch, one in `tau` at 0.1 um.
    def fall(x, dt):
        y = x / (c.kl * 1e-7)
        return x * (1 + (power - 1) * dt / tau * np.maximum(y, 0) ** (power - 1)) ** (-1 / (power - 1))
    c.march = (fall, lambda x, before, top, drag, dt: fall(x, dt))


@cause("lateral_recovery", 5, 2000, rest=(3e-11, 2e-10))
def stops_before_rest(c, d, slowness, rest):
    # Dry friction within the skin: a steady speed, and a stretch that stays.
    def fall(x, dt):
        return np.where(x > slowness * rest * c.kl, np.maximum(x - c.kl * dt / slowness, slowness * rest * c.kl), x)
    c.march = (fall, lambda x, before, top, drag, dt: fall(x, dt))


@cause("ridge_inertia", 2.5e-6, 2.5e-5, zeta=(0.2, 0.7), crossley=(1.0, 3.0))
def square_damping(c, d, mass, zeta, crossley):
    # Half of the damping grows with the square of the speed: as much as the other half at 0.15 m/s.
    half = zeta * np.sqrt(c.kn * mass)
    c.mean = lambda c: bounce(c, mass, half, half / 0.15, 20.0, 0.0, crossley)


@cause("normal_damping", 3e-8, 6e-6, share=(0.1, 0.6))
def dashpot_of_the_square(c, d, tau, share):
    # Part of the dashpot's force grows with the square of the speed, as much as the rest at 0.1 m/s; marched.
    def press(c, a):
        h, y, rate, force = 1 / (c.f * STEPS), np.zeros(len(a)), np.zeros(len(a)), np.zeros((len(a), STEPS))
        depth = np.where(c.F > c.kn * a, c.F / c.kn, -a * np.cos(np.interp(c.F / (c.kn * a), ARC, HALF)))
        grown = lambda v: tau * (1 - share + share * np.abs(v) / 0.1)
        for cycle in range(14):
            for i in range(STEPS):
                z, v = a * np.cos(THETA[i]), -a * np.sin(THETA[i]) * 2 * np.pi * c.f
                free = y + (y + depth) * np.expm1(-h / np.maximum(grown(rate), h / 20))
                push = c.kn * (z + depth + grown(v) * v)
                on = (z >= free) & (push > 0)
                rate, y = np.where(on, v, (free - y) / h), np.where(on, z, free)
                force[:, i] = np.where(on, push, 0)
            depth = depth + 0.6 * (c.F - force.mean(1)) / (c.kn * np.maximum((force > 0).mean(1), 0.1)) * (cycle < 13)
        return force
    c.press = press


@cause("load_dependent_friction", 0.03, 0.8, break_=(0.08, 0.3))
def area_beyond_a_load(c, d, n, break_):
    c.limit = lambda c, q, age: c.mu[:, None] * q * (np.maximum(q, break_) / break_) ** -n


@cause("load_dependent_friction", 0.03, 0.7, centre=(0.2, 0.5))
def from_one_coefficient_to_another(c, d, s, centre):
    c.mu = c.mu * (1 - s * 0.5 * (1 + np.tanh(1.2 * np.log(c.F / centre))))


@cause("contact_ageing", 5e-7, 4e-5)
def nucleating(c, d, tau):
    c.limit = lambda c, q, age: c.mu[:, None] * q * -np.expm1(-((age / tau) ** 2))


@cause("contact_ageing", 1e-3, 1.0, tau=(2e-7, 5e-6))
def logarithmic_in_age(c, d, s, tau):
    grown = lambda age: np.minimum(np.log1p(age / tau) / np.log1p(1e-3 / tau), 1)
    c.limit = lambda c, q, age: c.mu[:, None] * q * (1 - s * (1 - grown(age)))


@cause("rate_dependent_friction", 0.03, 0.8, hersey=(0.01, 0.08))
def over_the_hersey_number(c, d, s, hersey):
    # Mixed lubrication: speed over load, falling to the film's friction.
    number = c.U / c.F**0.4
    c.mu = c.mu * (1 - s * number / (number + hersey))


@cause("rate_dependent_friction", 0.02, 0.9, signed=True, knee=(0.01, 0.06))
def two_plateaus(c, d, s, knee):
    c.mu = c.mu * (1 + s * 0.5 * np.tanh(2 * np.log(c.U / knee)))


@cause("adhesion", 3e-3, 0.4, reach=(0.05e-6, 0.5e-6))
def meniscus_with_a_reach(c, d, fa, reach):
    def press(c, a):
        def forces(depth):
            into = a[:, None] * np.cos(turning(depth / a)) + depth[:, None]
            return c.kn[:, None] * np.maximum(into, 0), fa / (1 + np.maximum(-into, 0) / reach) ** 2
        def over(depth):
            push, pull = forces(depth)
            return (push - pull).mean(1) - c.F
        return forces(bisect(-a, a + 2 * (c.F + fa) / c.kn, over, 40))[0]
    c.press = press


@cause("adhesion", 3e-3, 0.6, tau=(5e-7, 6e-6))
def suction_that_builds_up(c, d, fa, tau):
    c.limit = lambda c, q, age: c.mu[:, None] * np.where(q > 0, q + fa * -np.expm1(-age / tau), 0)


@cause("moisture_drift", 0.02, 1.5, signed=True, middle=(0.2, 0.6), width=(0.1, 0.3))
def soaks_late(c, d, s, middle, width):
    c.mu = c.mu * np.exp(0.5 * s * (1 + np.tanh((d.t / d.duration - middle) / width)))


@cause("moisture_drift", 0.02, 1.2, needs="runs", middle=(0.3, 0.6))
def wetter_in_each_run(c, d, s, middle):
    # The skin dries between runs; in each it takes up water again, and less as the runs go on.
    share = d.trun / d.run_length
    c.mu = c.mu * (1 + s * share / (share + middle) * np.exp(-0.1 * (d.run - 1)))


@cause("multi_asperity", 0.05e-6, 4e-6, share=(0.25, 0.7))
def two_heights(c, d, h, share):
    size = np.broadcast_to(h, c.w.shape)
    c.heights = [(1 - share, size, 0.0), (share, size, -1.0)]


@cause("subsurface_relaxation", 0.03, 1.5, needs="runs", tau=(0.05, 0.3))
def creeps_anew_in_part(c, d, s, tau):
    share = 0.7 * d.t / d.duration + 0.3 * d.trun / d.run_length
    crept = 1 + s * -np.expm1(-share / tau)
    c.kn, c.kl = c.kn * crept, c.kl * crept**0.7


@cause("subsurface_relaxation", 0.05, 2.0, half=(0.2, 0.5))
def second_order_with_a_delay(c, d, s, half):
    share = d.t / d.duration
    c.kn = c.kn * (1 + s * share**3 / (share**3 + half**3))


@cause("stiffness_error", 0.05, 2.0, signed=True, power=(0.03, 0.12))
def stiffer_under_load(c, d, s, power):
    c.kn = c.kn * np.exp(0.6 * s) * (c.F / d.F_ref) ** (power * s)
    c.kl = c.kl * np.exp(0.9 * s) * (c.F / d.F_ref) ** (power * s)


@cause("amplitude_miscalibration", 0.05e-6, 1.2e-6, gain=(0.85, 1.15))
def floor_of_the_pick_up(c, d, floor, gain):
    c.w = gain * np.sqrt(np.maximum(c.w**2 - floor**2, 0))


@cause("amplitude_droop", 0.03, 3.0, corner=(0.3, 1.0), power=(0.0, 0.8))
def rises_with_load_and_stops(c, d, s, corner, power):
    c.w = c.w / (1 + s * -np.expm1(-((c.F / corner) ** 2)) * (c.f / d.f_ref) ** power)


@cause("amplitude_saturation", 0.1, 3.0)
def arctangent(c, d, s):
    x = np.maximum(s * c.w / d.w_top, 1e-9) * np.pi / 2
    c.w = c.w * np.arctan(x) / x


@cause("amplitude_saturation", 0.15, 1.6, power=(2.5, 4.0))
def folds_back(c, d, s, power):
    c.w = c.w / (1 + (s * c.w / d.w_top) ** power)


@cause("resonance_detuning", 0.2, 4.0, needs="runs", power=(0.5, 1.5))
def tuned_in_part_before_each_run(c, d, s, power):
    off = 0.7 * (d.t / d.duration) ** power + 0.3 * d.trun / d.run_length
    c.w = c.w * np.exp(-0.5 * (s * off) ** 2)


@cause("resonance_detuning", 0.2, 3.0, centre=(0.2, 0.6))
def passes_through_the_resonance(c, d, s, centre):
    c.w = c.w * 0.5 * (1 + np.exp(-((s * (d.t / d.duration - centre) * 2) ** 2)))


@cause("mode_shape", 0.05, 1.0, needs="positions", ring=(0.006, 0.012), centre=(-0.01, 0.01))
def rings_of_a_disc(c, d, s, ring, centre):
    from scipy.special import j0
    r = np.abs(d.x - centre) * np.pi / ring * np.sqrt(d.f / d.f_ref)
    c.w = c.w * np.sqrt((1 - s) ** 2 + (1 - (1 - s) ** 2) * (j0(r) ** 2 + 0.01) / 1.01)


@cause("force_crosstalk", 0.003, 0.3, signed=True, power=(1.1, 1.5))
def bends_with_the_load(c, d, s, power):
    c.read.append(lambda lateral, normal: (lateral + s * d.F_ref * (normal / d.F_ref) ** power, normal))


@cause("lateral_offset_drift", 1e-3, 0.1, needs="runs", signed=True, power=(0.5, 1.5))
def zeroed_in_part_before_each_run(c, d, s, power):
    c.read.append(lambda lateral, normal: (lateral + s * (0.8 * (d.t / d.duration) ** power + 0.2 * d.trun
                                                          / d.run_length), normal))


@cause("lateral_offset_drift", 1e-3, 0.1, signed=True, waves=(0.3, 0.8), phase=(0.0, 6.28))
def follows_the_room(c, d, s, waves, phase):
    c.read.append(lambda lateral, normal: (lateral + s * np.sin(2 * np.pi * waves * d.t / d.duration + phase), normal))


@cause("normal_offset", 3e-3, 0.15, signed=True, start=(0.1, 0.8), middle=(0.3, 0.7))
def creeps_to_another_zero(c, d, s, start, middle):
    share = 0.5 * (1 + np.tanh((d.t / d.duration - middle) / 0.12))
    offset = s * np.minimum(1, 0.4 * d.F.min() / np.abs(s)) * (start + (1 - start) * share)
    c.read.append(lambda lateral, normal: (lateral, normal + offset))


@cause("plate_tilt", 0.004, 0.25, needs="positions", signed=True, waves=(0.5, 1.0), phase=(0.0, 6.28), part=(0.1, 0.5))
def wavy_plate(c, d, s, waves, phase, part):
    angle = s * (1 + part * np.sin(2 * np.pi * waves * d.x / 0.04 + phase))
    c.read.append(lambda lateral, normal: (lateral * np.cos(angle) + normal * np.sin(angle),
                                           normal * np.cos(angle) - lateral * np.sin(angle)))


@cause("speed_error", 0.1, 4.0)
def slips_beyond_a_speed(c, d, s):
    c.U = c.U / (1 + (s * c.U / d.U_top) ** 1.5) ** (1 / 1.5)


@cause("speed_ripple", 0.05, 0.95, needs="positions", pitch=(0.004, 0.01), phase=(0.0, 1.0))
def triangle_of_the_screw(c, d, s, pitch, phase):
    share = (d.x / pitch + phase) % 1
    c.U = c.U * np.maximum(1 + s * (4 * np.abs(share - 0.5) - 1), 0.05)


# ---- ten strangers ---------------------------------------------------------------------------------------------------
@stranger("jump over speed", "jump", "speed_m_s", 0.02, 0.6, needs="filling", place=(0.35, 0.65))
def _(c, d, s, place):
    c.mu = c.mu * np.exp(s * (d.U > np.quantile(d.U, place)))


@stranger("jump in time", "jump", "time_s", 0.02, 0.6, place=(0.3, 0.7))
def _(c, d, s, place):
    c.mu = c.mu * np.exp(s * (d.t > place * d.duration))


@stranger("jump over temperature", "jump", "temperature_c", 2e-3, 0.1, needs="weather", place=(0.35, 0.65))
def _(c, d, s, place):
    c.read.append(lambda lateral, normal: (lateral + s * (d.T > np.quantile(d.T, place)), normal))


@stranger("bump over humidity", "bump", "relative_humidity_pct", 0.03, 1.2, needs="weather", place=(0.3, 0.7),
          width=(2.0, 4.0))
def _(c, d, s, place, width):
    c.mu = c.mu * np.exp(s * np.exp(-0.5 * ((d.RH - np.quantile(d.RH, place)) / width) ** 2))


@stranger("bump over position", "bump", "position_m", 0.03, 1.2, needs="positions", place=(-0.01, 0.01),
          width=(0.002, 0.004))
def _(c, d, s, place, width):
    c.mu = c.mu * np.exp(s * np.exp(-0.5 * ((d.x - place) / width) ** 2))


@stranger("resonance over frequency", "bump", "frequency_hz", 0.03, 1.2, needs="filling frequencies",
          place=(0.35, 0.65), q=(20, 40))
def _(c, d, s, place, q):
    off = q * (d.f / (d.f.min() + place * np.ptp(d.f)) - 1)
    c.mu = c.mu * np.exp(s / (1 + off**2) * (d.w > 0))


@stranger("period over position", "period", "position_m", 0.02, 0.6, needs="positions", period=(0.003, 0.009),
          phase=(0.0, 6.28))
def _(c, d, s, period, phase):
    c.mu = c.mu * (1 + s * np.sin(2 * np.pi * d.x / period + phase))


@stranger("period in time", "period", "time_s", 1e-3, 0.1, passes=(6.0, 14.0), phase=(0.0, 6.28))
def _(c, d, s, passes, phase):
    c.read.append(lambda lateral, normal: (lateral + s * np.sin(2 * np.pi * d.t / (passes * d.step) + phase), normal))


@stranger("memory of the last load", "memory", "normal_force_n", 0.02, 0.6)
def _(c, d, s):
    c.mu = c.mu * (d.last / d.F_ref) ** s


@stranger("rough over load", "rough", "normal_force_n", 0.02, 0.5, needs="filling", a=(5.0, 8.0), b=(9.0, 13.0),
          phase=(0.0, 6.28))
def _(c, d, s, a, b, phase):
    c.mu = c.mu * np.exp(s * 0.7 * (np.sin(a * np.log(c.F) + phase) + np.sin(b * np.log(c.F) + 2 * phase)))


# ---- designs of a laboratory ---------------------------------------------------------------------------------------
def draw(rng, kind, low, high, levels, n):
    """Settings between two ends on a logarithmic scale: some levels, or any."""
    if kind == "filling":
        return low * (high / low) ** rng.permutation((np.arange(n) + rng.random(n)) / n)
    return rng.permutation(np.resize(np.geomspace(low, high, levels), n))


def design(rng, needs):
    """All passes of a table, those of the hidden ones included: 60 to 140 are measured."""
    while True:
        d = drawn(rng, needs)
        if 60 <= (~d.hidden).sum() <= 140 and 0.05 < d.region.mean() < 0.25:
            return d


def drawn(rng, needs):
    """One draw of a design."""
    kind = "filling" if "filling" in needs else rng.choice(["grid", "filling", "sweeps"])
    n = int(rng.integers(60, 141) / 0.72)
    d = SimpleNamespace(kind=str(kind))
    wide = rng.uniform(0.7, 1.3)
    d.w = draw(rng, kind, 0.3e-6 * wide, 3e-6 * wide, int(rng.integers(4, 8)), n)
    many = "frequencies" in needs or rng.random() < 0.5
    d.f = draw(rng, kind, 23e3, 36e3, int(rng.integers(2, 5)), n) if many else np.full(n, 27.5e3)
    d.U = draw(rng, kind, 5e-3, 80e-3, int(rng.integers(3, 7)), n)
    level = draw(rng, kind, 0.1, 1.0, int(rng.integers(3, 6)), n)
    if kind == "sweeps":  # each setting leaves its middle in one pass of two
        for column in (d.w, d.f, d.U, level):
            column[rng.random(n) < 0.5] = np.sort(column)[n // 2]
    d.w = np.where(rng.random(n) < 0.18, 0.0, d.w)
    d.F = level * (1 + 0.02 * rng.standard_normal(n))
    d.dir = np.where(rng.random(n) < 0.5, 1.0, -1.0)
    d.step = rng.uniform(3.0, 9.0)
    runs = int(rng.integers(4, 8)) if "runs" in needs or rng.random() < 0.5 else 1
    d.run = 1 + (np.arange(n) * runs) // n
    rest = rng.uniform(30, 300)
    d.t = d.step * (np.arange(n) + rng.uniform(0, 0.2, n)) + rest * (d.run - 1)
    starts = np.array([d.t[d.run == k].min() for k in range(1, runs + 1)])
    d.trun = d.t - starts[d.run - 1]
    d.run_length = d.trun.max() + d.step
    d.x = rng.uniform(-0.018, 0.018, n) if rng.random() < 0.6 else 0.006 * rng.integers(-3, 4,
                                                            n) + 4e-4 * rng.standard_normal(n)
    weather = "weather" in needs or rng.random() < 0.3
    d.T = 22 + (4 * (rng.permutation(n) / n - 0.5) if weather else 0.03 * rng.standard_normal(n))
    d.RH = 45 + (20 * (rng.permutation(n) / n - 0.5) if weather else 0.2 * rng.standard_normal(n))
    d.p = np.where(rng.random(n) < 0.3, 20e3, 101325.0) if rng.random() < 0.2 else np.full(n, 101325.0)
    d.last = np.concatenate([d.F[:1], d.F[:-1]])
    d.columns = {"position_m": "positions" in needs or rng.random() < 0.6,
                 "ambient_pressure_pa": np.ptp(d.p) > 0 or rng.random() < 0.5,
                 "temperature_c": weather or rng.random() < 0.3, "relative_humidity_pct": weather or rng.random() < 0.3,
                 "run": runs > 1}
    d.runs = runs
    d.f_ref, d.F_ref, d.w_top, d.U_top = np.exp(np.log(d.f).mean()), np.exp(np.log(d.F).mean()), d.w.max(), d.U.max()
    d.duration = d.t.max()
    # A corner of two settings is wholly hidden, and one pass in six elsewhere.
    a, b = rng.choice(3, 2, replace=False)
    ends = [np.where(d.w > 0, d.w, -np.inf), d.U, d.F]
    ends[1:] = [e if rng.random() < 0.5 else -e for e in ends[1:]]
    beyond = lambda e, q: e >= np.quantile(e[np.isfinite(e)], q)
    d.region = beyond(ends[a], 0.68) & beyond(ends[b], 0.5)
    d.hidden = d.region | (rng.random(n) < 1 / 6)
    return d


def rows(d, keep):
    """Some of the passes."""
    e = SimpleNamespace(**vars(d))
    for name in COLUMNS + ("region", "hidden"):
        setattr(e, name, getattr(d, name)[keep])
    return e


# ---- noise ---------------------------------------------------------------------------------------------------------
NOISE = ("gaussian", "student", "lasting", "outliers", "runs")


def scatter(rng, kind, d):
    """Relative deviations of the passes, in units of the stated repeatability."""
    n = len(d.w)
    e = rng.standard_normal(n)
    if kind == "student":
        e = rng.standard_t(3, n) / np.sqrt(3)
    elif kind == "lasting":
        slow = np.zeros(n)
        for i in range(n):
            slow[i] = (0.85 * slow[i - 1] if i else 0.0) + np.sqrt(1 - 0.85**2) * rng.standard_normal()
        e = np.sqrt(0.5) * (e + slow)
    elif kind == "outliers":
        off = rng.permutation(n)[: max(1, round(0.02 * n))]
        e[off] += rng.choice([-1, 1], len(off)) * rng.uniform(8, 25, len(off))
    elif kind == "runs":
        e = e + 2.5 * rng.standard_normal(d.runs)[d.run - 1]
    return e


STRATA = ("single", "pair", "none", "stranger")


# ---- sets ----------------------------------------------------------------------------------------------------------
def recalibrated(d, force, normal, rig, sd):
    """Stiffnesses and mu0 refitted to noise-free forces under their priors; returns the force on any passes."""
    still = d.w == 0
    start = (d.dir * force * normal)[still].sum() / (normal[still] ** 2).sum() if still.any() else (np.abs(force)
                                                            / normal).max()
    widths = np.array([0.3, rig["sd"], rig["sd"]])
    nominal = np.array([start, rig["kn"], rig["kl"]])

    def model(e, load, u):
        own = SimpleNamespace(**vars(e))
        own.F = load
        return evaluate(own, None, (), *(nominal * np.exp(widths * u)))[0]

    u = np.zeros(3)
    for _ in range(6):
        base = model(d, normal, u)
        slopes = np.stack([(model(d, normal, u + s * e) - base) / s for s, e in zip(0.01 / widths, np.eye(3))],
                          1) / sd[:, None]
        u = u + np.linalg.solve(slopes.T @ slopes + np.eye(3), slopes.T @ ((force - base) / sd) - u)
        u = np.clip(u, -12, 12)
    return (lambda e, load: model(e, load, u)), nominal * np.exp(widths * u)


def deviations(rig, lateral, normal):
    """Stated standard deviation of each pass's lateral force."""
    return np.sqrt((rig["r"] * lateral) ** 2 + rig["q"] ** 2 * (1 + (lateral / normal) ** 2))


def gap_of(d, act, values, rig):
    """Noise-free forces, chi2 of the training gap, rms of the hidden one, the floor, and what is left on hidden rows."""
    lateral, normal = evaluate(d, act, values, rig["mu0"], rig["kn_true"], rig["kl_true"])
    train, hidden = rows(d, ~d.hidden), rows(d, d.hidden)
    sd = deviations(rig, lateral, normal)
    model, _ = recalibrated(train, lateral[~d.hidden], normal[~d.hidden], rig, sd[~d.hidden])
    chi2 = (((lateral[~d.hidden] - model(train, normal[~d.hidden])) / sd[~d.hidden]) ** 2).sum()
    full = rig["mu0"] * normal[d.hidden]
    left = (lateral[d.hidden] - model(hidden, normal[d.hidden])) / full
    return lateral, normal, chi2, np.sqrt((left**2).mean()), np.sqrt(((sd[d.hidden] / full) ** 2).mean()), left


def with_size(rng, form, d, rig):
    """Shapes by chance; the size whose gap is as many deviations of a pass as chance wants, from 0.7 to 10."""
    shapes = [rng.uniform(*bounds) for bounds in form.shapes.values()]
    wanted = np.log((0.7 * (10 / 0.7) ** rng.random()) ** 2 * (~d.hidden).sum())
    sign = rng.choice([-1, 1]) if form.signed else 1
    ladder = np.geomspace(form.low, form.high, 5)
    found = [np.log(gap_of(d, form.act, (sign * s, *shapes), rig)[2] + 1e-3) for s in ladder]
    above = [i for i in range(5) if found[i] >= wanted]
    if not above:
        return (sign * ladder[int(np.argmax(found))], *shapes)
    i = above[0]
    share = 0.0 if i == 0 else (found[i] - wanted) / max(found[i] - found[i - 1], 1e-9)
    return (sign * ladder[i] * (ladder[max(i - 1, 0)] / ladder[i]) ** share, *shapes)


def both(members, values):
    """Two causes together."""
    def act(c, d, *_):
        for form, v in zip(members, values):
            form.act(c, d, *v)
    return act


# Of a pair at most one member may replace each part of the contact.
SLOTS = {"squeeze_film": "F", "lateral_recovery": "march", "ridge_inertia": "all", "normal_damping": "press",
         "contact_ageing": "limit",
         "adhesion": "press limit", "multi_asperity": "press", "load_dependent_friction": "limit"}


def chosen(rng, stratum, index):
    """The forms of a set: causes in turn, their forms by chance."""
    names = sorted(CAUSES)
    pick = lambda name: CAUSES[name][int(rng.integers(len(CAUSES[name])))]
    if stratum == "single":
        return [pick(names[index % len(names)])]
    if stratum == "stranger":
        return [STRANGERS[sorted(STRANGERS)[index % len(STRANGERS)]]]
    while stratum == "pair":
        a, b = (str(x) for x in rng.choice([x for x in names if x != "ridge_inertia"], 2, replace=False))
        if not set(SLOTS.get(a, "").split()) & set(SLOTS.get(b, "").split()):
            return [pick(a), pick(b)]
    return []


def make(folder, stratum, index, seed):
    """One set: everything follows from the seed, the stratum and the index."""
    rng = np.random.default_rng([seed, STRATA.index(stratum), index])
    forms = chosen(rng, stratum, index)
    kind = NOISE[int(rng.integers(len(NOISE)))]
    needs = " ".join([f.needs for f in forms] + (["runs"] if kind == "runs" else []))
    d = design(rng, needs)
    rig = {"kn": 10 ** rng.uniform(6.2, 6.75), "sd": 0.05, "mu0": rng.uniform(0.25, 0.9), "r": rng.uniform(0.008, 0.02),
           "q": rng.uniform(4e-4, 1e-3)}
    rig["kl"] = rig["kn"] * rng.uniform(0.25, 0.6)
    rig["kn_true"], rig["kl_true"] = (rig[k] * np.exp(rig["sd"] * rng.standard_normal()) for k in ("kn", "kl"))
    values = [with_size(rng, f, d, rig) for f in forms]
    lateral, normal, chi2, gap, floor, left = gap_of(d, both(forms, values), (), rig)
    load = normal + rig["q"] * rng.standard_normal(len(normal))
    noisy = lateral * (1 + rig["r"] * scatter(rng, kind, d)) + rig["q"] * rng.standard_normal(len(normal))
    write(folder, d, rig, load, noisy)
    hidden = [{"point": int(i), "lateral_force_n": round(float(lateral[i]), 8),
               "mu0_f_n": round(float(rig["mu0"] * normal[i]), 8),
               "in_hidden_region": bool(d.region[i]), "recalibrated_error": round(float(e), 7)}
              for i, e in zip(np.flatnonzero(d.hidden), left)]
    truth = {
        "cause": ["outside the library"] if stratum == "stranger" else sorted(f.name for f in forms),
        "detectable": bool(chi2 >= 30 and gap > floor), "chi2_over_recalibrated": round(float(chi2),
                                                            1), "gap": round(float(gap), 5),
        "floor": round(float(floor), 5), "stratum": stratum,
        "alone": [round(float(gap_of(d, f.act, v, rig)[2]), 1) for f, v in zip(forms, values)], "form": [f.form
                                                            for f in forms], "values": [[float(x) for x in v]
                                                            for v in values],
        "noise": kind, "design": d.kind, "passes": int((~d.hidden).sum()),
        "stranger": {"structure": forms[0].structure,
                     "covariate": forms[0].covariate} if stratum == "stranger" else None, "hidden": hidden,
        "noise_free": [{"point": int(i), "lateral_force_n": round(float(lateral[i]), 8),
                        "normal_force_n": round(float(normal[i]), 8)} for i in np.flatnonzero(~d.hidden)]}
    (folder / "truth.json").write_text(json.dumps(truth))
    return truth


def write(folder, d, rig, load, noisy):
    """train.csv, conditions.csv and rig.toml."""
    folder.mkdir(parents=True, exist_ok=True)
    extra = [(name, values, digits) for name, values, digits in (
        ("position_m", d.x, 5), ("ambient_pressure_pa", d.p, 0), ("temperature_c", d.T, 3), ("relative_humidity_pct",
                                                            d.RH, 2),
        ("run", d.run, 0)) if d.columns[name]]
    head = ["point", "time_s", "amplitude_pp_m", "frequency_hz", "speed_m_s", "direction", "normal_force_n"]
    for name, keep, lateral in (("train.csv", ~d.hidden, True), ("conditions.csv", d.hidden, False)):
        lines = [",".join(head + ["lateral_force_n"] * lateral + [e[0] for e in extra])]
        for i in np.flatnonzero(keep):
            line = [f"{i}", f"{d.t[i]:.3f}", f"{d.w[i]:.6e}", f"{d.f[i]:.1f}", f"{d.U[i]:.6e}", f"{d.dir[i]:.0f}",
                    f"{load[i]:.6f}"]
            line += [f"{noisy[i]:.6f}"] * lateral + [f"{v[i]:.{k}f}" for _, v, k in extra]
            lines.append(",".join(line))
        (folder / name).write_text("\n".join(lines) + "\n")
    (folder / "rig.toml").write_text(
        f"[finger]\nnormal_stiffness_n_per_m = {rig['kn']:.6e}\nlateral_stiffness_n_per_m = {rig['kl']:.6e}\n"
        f"stiffness_relative_sd = {rig['sd']}\npoisson_ratio = 0.33\n\n"
        f"[noise]\npass_relative_sd = {rig['r']:.5f}\nforce_sd_n = {rig['q']:.6f}\n")


def mixed(count):
    """The numbers of all sets, mixed, so that the first few are a fair sample."""
    return np.random.default_rng(3).permutation(count)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path)
    parser.add_argument("--seed", type=int, required=True)
    for name, count in (("singles", 110), ("pairs", 30), ("none", 20), ("strangers", 40)):
        parser.add_argument(f"--{name}", type=int, default=count)
    a = parser.parse_args()
    sets = [(s, i) for s, count in zip(STRATA, (a.singles, a.pairs, a.none, a.strangers)) for i in range(count)]
    for number in mixed(len(sets)):
        truth = make(a.out / f"set-{number:03}", *sets[number], a.seed)
        print(f"set-{number:03}", *(truth[k] for k in ("cause", "form", "noise", "design", "passes", "detectable",
                                                       "chi2_over_recalibrated", "gap", "floor")), flush=True)


if __name__ == "__main__":
    main()
