#!/usr/bin/env python3
"""Labelled tables of a finger on a vibrating plate, for `muprime diagnose`: the fifth generator (numpy, SciPy).

usage: fifth_generator.py OUT --seed S [--singles 110] [--pairs 30] [--none 20] [--strangers 40]

Contact, designs, noise, search of the size and files are those of fourth_generator.py; the forms of all causes and the
strangers are others. They were written from textbooks, papers and data sheets on films, skin, bonds, drives and sensors
without a look at muprime's models, so they measure the diagnosis on forms to which nobody has fitted it. Names and
units are those of the fourth generator; everything follows from the seed, the stratum and the index.
"""
from types import SimpleNamespace

import numpy as np
from scipy.special import erf, erfcx, expit

import fourth_generator as g
from fourth_generator import F0, HUMIDITY, KHZ30, MM, TAU, U0, UM, last, off_peak, pace, quantiles, read, stiffen, tilt

ONE_CHAIN, SEARCH = g.ridge_march, g.choose_size    # the fourth's march of one mass a ridge, its search of the size
STOREY_STEPS, STOREY_CYCLES, STOREY_KEPT = 400, 80, 40


# ---------------------------------------------------------------------------------------------------------------------
# Helpers of the forms

def follow(m, target, tau, start=0.0):
    """State that follows `target` with a lag `tau`; the target of a pass acts since the pass before."""
    out, state, before = np.zeros_like(m.t), start, m.t[0]
    for i, now in enumerate(m.t):
        state += (target[i] - state) * -np.expm1(-(now - before) / tau)
        out[i], before = state, now
    return out


def driven(m):
    """Square of the plate's velocity (about one at 2 um and 30 kHz), zero over the pauses between runs."""
    return np.where(m.rt > 0, (m.w * m.f / 0.06) ** 2, 0.0)


def chance(mark, count):
    """Standard normal numbers that belong to `mark`."""
    return np.random.default_rng(int(mark)).standard_normal(count)


def floating_gap(m, s, rest, decay):
    """Asperities whose force decays with the gap (Persson) share the load with a film that opens the gap."""
    film = lambda gap: 1.25 * s * m.p * (m.w / 2 / gap) ** 2
    asperities = lambda gap: F0 * np.exp((rest - gap) / decay)
    gap = g.bisect(lambda h: m.F - film(h) - asperities(h), 0 * m.F + 0.02 * UM, 0 * m.F + 60 * UM, 50)
    return dict(borne=np.clip(asperities(gap) / m.F, 0.02, 1))


def strip_film(m, s, gap, width):
    """Linearised Reynolds film of vented strips (Blech): its spring acts beside that of the skin."""
    z = np.sqrt(np.minimum(6 * 1.8e-5 * TAU * m.f * width ** 2 / (m.p * gap ** 2), 4e3))
    trapped = 1 - (np.sinh(z) + np.sin(z)) / (np.cosh(z) + np.cos(z)) / z
    return dict(borne=1 / (1 + 1.25 * s * m.p * (m.w / 2 / gap) ** 2 * trapped / m.F))


def released(off, own, zeta):
    """Share of a stretch that is left in a mass on a spring, let go from rest `off` ago."""
    damped = np.sqrt(1 - zeta ** 2)
    angle = TAU * own * off
    return np.exp(-zeta * angle) * (np.cos(damped * angle) + zeta / damped * np.sin(damped * angle))


def dieterich(m, s, slip, cut):
    """Ageing law: a junction's state grows with time, and sliding over `slip` renews it; one in steady sliding."""
    def law(time, normal, cycle):
        steady = slip / np.repeat(m.U, len(time) // len(m.U))[:, None]
        return 1 + s * np.log((steady * -np.expm1(-time / steady) + cut) / (steady + cut))
    return dict(bonded=law)


def zener(m, s, tau):
    """Standard linear solid whose storage stiffness is the rig's at 30 kHz."""
    storage, x = lambda z: 1 + s * z ** 2 / (1 + z ** 2), TAU * m.f * tau
    return dict(kn=m.kn * storage(x) / storage(TAU * KHZ30 * tau), loss=s * x / (1 + x ** 2) / storage(x))


def adhere(pull, grip):
    """Pull-off force, and the adhesion that friction feels."""
    return dict(pull=pull, more=lambda normal: grip[:, None])


def part_heavy(s, share, ratio, zeta):
    """Only a share of the ridges has the mass; the others follow the plate at once."""
    as_is = lambda m, ridge: SimpleNamespace(**{**vars(m), "ridge": ridge})
    return dict(ridge=lambda m: share * ONE_CHAIN(as_is(m, (s + 0 * m.F, ratio, zeta)))
                + (1 - share) * g.friction(as_is(m, None)))


def storeys(s, first, second, zeta):
    """Epidermal ridge s and dermis second * s in a chain of three springs, `first` the compliance of the surface."""
    def march(m):
        out, moving = m.mu * m.F, m.w > 0
        kn, kl, mu, f, speed, load, half = (v[moving] for v in (m.kn, m.kl, m.mu, m.f, m.U, m.F, m.w / 2))
        start, end, depth, whole = g.plain_contact(load / (kn * half))
        held, depth = kn * np.where(whole, 1, (end - start) / TAU), depth * half
        surface, inner, h = kn / first, 2 * kn / (1 - first), 1 / (f * STOREY_STEPS)
        ridge, dermis, drag = s, second * s, 2 * zeta * np.sqrt(inner * s)
        y, z, vy, vz, stretch, kept = -depth, -depth, 0 * f, 0 * f, 0 * f, 0 * f
        before = surface * np.maximum(half - y, 0)
        for cycle in range(STOREY_CYCLES):
            pressed = sheared = 0.0
            for height in np.cos(TAU * np.arange(1, STOREY_STEPS + 1) / STOREY_STEPS):
                between = inner * (y - z) + drag * (vy - vz)
                vy = vy + h / ridge * (before - between)
                vz = vz + h / dermis * (between - inner * (z + depth) - drag * vz)
                y, z = y + h * vy, z + h * vz
                normal = surface * np.maximum(height * half - y, 0)
                stretch = np.minimum(stretch + speed * h * np.where(before > 0, 1, 0.5), mu * normal / kl)
                pressed, sheared, before = pressed + normal, sheared + stretch, normal
            late = cycle >= STOREY_CYCLES - STOREY_KEPT
            kept = kept + late * sheared
            depth = depth + (0.1 if late else 0.3) * (load - pressed / STOREY_STEPS) / held
        out[moving] = kl * kept / (STOREY_STEPS * STOREY_KEPT)
        return out
    return dict(ridge=march)


def touching(m):
    """Share of the cycle in which the finger touches the plate."""
    start, end, _, whole = g.plain_contact(m.F / (m.kn * np.maximum(m.w / 2, 1e-13)))
    return np.where(whole, 1, (end - start) / TAU)


def clipped(x):
    """Fundamental of a sine of height x that is clipped at one, per height."""
    y = 1 / np.maximum(x, 1)
    return 2 / np.pi * (np.arcsin(y) + y * np.sqrt(1 - y ** 2))


def consolidated(z):
    """Terzaghi's degree of consolidation at the time factor z."""
    odd = 2 * np.arange(40) + 1
    return 1 - 8 / np.pi ** 2 * (np.exp(-np.outer(z, (odd * np.pi / 2) ** 2)) / odd ** 2).sum(axis=1)


# ---------------------------------------------------------------------------------------------------------------------
# The forms, in rows like those of the fourth generator

WHOLE = quantiles(13)
FORM_TABLE = [
    ("normal", "squeeze_film", "floating_gap", 1e-8, 8e-5, 0, [(1.5 * UM, 5 * UM), (0.3 * UM, 1 * UM)], "",
     "film on an area s that opens the gap and so unloads asperities of exponential compliance", floating_gap),
    ("normal", "squeeze_film", "vented_strips", 1e-8, 2e-4, 0, [(1 * UM, 4 * UM), (0.1 * MM, 0.5 * MM)], "",
     "Blech's film of strips on an area s, vented by the grooves; its spring acts beside the skin's", strip_film),
    ("shear", "lateral_recovery", "swinging_ridge", 0.01, 1.5, 0, [(3e3, 12e3), (0.3, 0.8)], "",
     "a ridge with mass sets off slowly when let go, and may swing past its rest (own frequency, damping ratio)",
     lambda m, s, own, zeta: dict(kept=lambda peak, mean, off: s * peak * released(off, own, zeta))),
    ("shear", "lateral_recovery", "overstretched", 0.02, 4.0, 0, [(0.05 * UM, 0.5 * UM), (5e-6, 80e-6)], "",
     "only stretch beyond an elastic range stays, and seeps away by diffusion (fractional Voigt tissue)",
     lambda m, s, y, tau: dict(kept=lambda peak, mean, off: s * peak ** 2 / (peak + y) * erfcx(np.sqrt(off / tau)))),
    ("ridge", "ridge_inertia", "part_heavy", 2e-6, 1.5e-4, 0, [(0.4, 0.8), (1.5, 4.0), (0.05, 0.3)], "",
     "a share of the ridges is heavy, as where sweat fills the grooves beside them; the others have no mass",
     lambda m, *shapes: part_heavy(*shapes)),
    ("ridge", "ridge_inertia", "two_storeys", 1e-6, 1.0e-4, 0, [(0.15, 0.4), (0.5, 2.0), (0.05, 0.3)], "",
     "ridge and dermis as two masses in a chain, with dashpots between them", lambda m, *shapes: storeys(*shapes)),
    ("normal", "normal_damping", "zener_pad", 0.02, 8.0, 0, [(1e-6, 12e-6)], "",
     "standard linear solid of relaxation strength s: loss and stiffness both change with frequency", zener),
    ("normal", "normal_damping", "thinning_tissue", 0.01, 3.0, 0, [(0.3, 0.7)], "",
     "shear-thinning fluid in the tissue, velocity to the power n: the loss is smaller at large amplitude",
     lambda m, s, n: dict(loss=s * (m.f / KHZ30) ** n * (np.maximum(m.w, 0.1 * UM) / UM) ** (n - 1))),
    ("level", "load_dependent_friction", "persson_area", 0.02, 1.0, 0, [(0.15, 0.8)], "",
     "real area as Persson's erf(F/Fc) in a share s of the friction: Coulomb at light load, then towards 1/F",
     lambda m, s, fc: dict(mu=m.mu * (1 - s + s * erf(m.F / fc) / m.F * F0 / erf(F0 / fc)))),
    ("level", "load_dependent_friction", "log_pad", 0.005, 0.5, 1, [(0.02, 0.2)], "",
     "logarithm of load and a preload by adhesion, as the gross area of a fingertip grows",
     lambda m, s, fb: dict(mu=m.mu * np.maximum(1 + s * np.log((m.F + fb) / (F0 + fb)), 0.1))),
    ("normal", "load_dependent_friction", "limiting_shear", 0.03, 6.0, 0, [(1.0, 3.0)], "",
     "a lipid layer bears only a limiting shear stress at the pressure of the instant (Bair and Winer)",
     lambda m, s, n: dict(pull=0 * m.F, more=lambda normal: normal * (
         ((1 + s ** n) / (1 + (s * np.maximum(normal, 0) / F0) ** n)) ** (1 / n) - 1))),
    ("shear", "contact_ageing", "slip_renewed", 0.004, 0.4, 0, [(0.1 * UM, 2 * UM), (1e-7, 2e-6)], "",
     "Dieterich's ageing law: junctions age in flight and are renewed by slip, so speed counts", dieterich),
    ("shear", "contact_ageing", "paired_bonds", 0.02, 0.98, 0, [(2e-6, 30e-6)], "",
     "bonds of two partners form by kinetics of the second order, 1/(1 + t/tau)",
     lambda m, s, tau: dict(bonded=lambda time, normal, cycle: 1 - s / (1 + time / tau))),
    ("level", "rate_dependent_friction", "sweat_drag", 0.01, 0.8, 0, [(0.4, 1.0)], "",
     "drag of a sheared liquid layer (power law) on an area that grows as F^(2/3)",
     lambda m, s, n: dict(mu=m.mu * (1 - s + s * (m.U / U0) ** n * (m.F / F0) ** (-1 / 3)))),
    ("level", "rate_dependent_friction", "bond_lifetime", 0.01, 0.8, 0, [(8 * MM, 80 * MM)], "",
     "stretched bonds of a lifetime (Chernyak and Leonov): rise at slow, 1/U at fast sliding",
     lambda m, s, uc: dict(mu=m.mu * (1 + s * ((x := m.U / uc) * (1 - (1 + 1 / x) * np.exp(-1 / x)) / 0.298 - 0.7)))),
    ("normal", "adhesion", "stray_voltage", 1e-3, 1.0, 0, [(1.6, 2.2)], "",
     "electroadhesion by the drive's stray voltage", lambda m, s, n: adhere(a := s * (m.w / (2 * UM)) ** n, a)),
    ("normal", "adhesion", "tribocharge", 1e-3, 0.4, 0, [(40, 300), (100, 2000)], "time runs",
     "charge that rubbing builds up within a run and that leaks off in the pauses; pulls by its square",
     lambda m, s, rise, fall: adhere(a := s * g.soaked(m, rise, fall) ** 2, a)),
    ("normal", "adhesion", "peeling_rate", 3e-4, 0.3, 0, [(0.02, 0.2), (0.3, 0.6)], "",
     "a soft adhesive joint: pull-off grows by a power of the plate's velocity (Gent and Schultz)",
     lambda m, s, v, n: adhere(s * (1 + (np.pi * m.w * m.f / v) ** n), s + 0 * m.F)),
    ("level", "moisture_drift", "past_the_wettest", 0.01, 0.8, 1, [(0.15, 0.5)], "time",
     "friction rises as skin grows moist and falls as it grows wet, in the course of the session",
     lambda m, s, b: dict(mu=m.mu * (1 + s * (z := m.t / m.t[-1] / b) * np.exp(1 - z)))),
    ("level", "moisture_drift", "follows_the_air", 0.01, 0.9, 1, [(150, 1500)], "humidity time",
     "skin follows the humidity of the room with a lag",
     lambda m, s, tau: dict(mu=m.mu * np.maximum(1 + s * (follow(m, m.H, tau, m.H[0]) - m.H[0]) / 15, 0.1))),
    ("normal", "multi_asperity", "dome", 3e-8, 4e-6, 0, [(0.7, 2.5)], "",
     "a dome (area grows evenly with depth), or a blunter one", lambda m, s, n: dict(heights=s * WHOLE ** n)),
    ("normal", "multi_asperity", "lay_of_turning", 3e-8, 4e-6, 0, [(-0.4, 0.4)], "",
     "marks of a tool: a sine with its second harmonic",
     lambda m, s, b: dict(heights=s * (np.cos(np.pi * WHOLE) + b * np.cos(TAU * WHOLE)))),
    ("stiffness", "subsurface_relaxation", "thixotropic", 0.05, 4.0, 1, [(60, 600), (0.5, 1.3)], "time",
     "vibration restructures the tissue at the rate of its square; rest restores it",
     lambda m, s, tau, b: stiffen(m, c := s * follow(m, driven(m), tau), b * c)),
    ("stiffness", "subsurface_relaxation", "consolidation", 0.05, 2.0, 1, [(0.1, 1.2), (0.4, 1.2)], "time",
     "fluid drains out of the pad as from loaded soil (Terzaghi), by the root of time at first",
     lambda m, s, n, b: stiffen(m, c := s * consolidated(n * m.t / m.t[-1]), b * c)),
    ("stiffness", "stiffness_error", "mindlin_ratio", 0.2, 1.8, 1, [(0.3, 1.0)], "",
     "ratio of the stiffnesses misjudged: one too large, the other too small", lambda m, s, b: stiffen(m, -b * s, s)),
    ("stiffness", "stiffness_error", "skin_grain", 0.05, 1.8, 1, [(0.3, 0.9), (0.05, 0.25)], "",
     "off by exp(s), and skin is laterally stiffer in one direction of the stroke",
     lambda m, s, b, n: stiffen(m, b * s, s * (1 + n * m.way))),
    ("plate", "amplitude_miscalibration", "range_change", 0.03, 0.9, 1, [(0.5 * UM, 1.6 * UM)], "",
     "the vibrometer's upper range has another gain; ranges change at an amplitude, hardly blurred",
     lambda m, s, wc: dict(w=m.w * (1 + s * expit((m.w - wc) / (0.04 * UM))))),
    ("plate", "amplitude_miscalibration", "rayleigh_ceramic", 0.02, 0.7, 1, [(0.4 * UM, 2 * UM)], "",
     "amplitude told from the voltage by one constant, but the ceramic's follows voltage by a power 1 + s",
     lambda m, s, wc: dict(w=m.w * (np.maximum(m.w, 1e-9) / wc) ** s)),
    ("plate", "amplitude_droop", "damped_in_touch", 0.02, 10.0, 0, [(0.7, 2.0)], "",
     "the finger damps the plate only in the share of the cycle in which it touches",
     lambda m, s, n: dict(w=m.w / (1 + s * touching(m) ** n))),
    ("plate", "amplitude_droop", "coulomb_loss", 0.02 * UM, 8 * UM, 0, [(0.5, 1.0)], "",
     "dry friction in the pad takes a fixed amount of amplitude rather than a share, by a power of load",
     lambda m, s, n: dict(w=np.maximum(m.w - s * m.F ** n, 0.05 * m.w))),
    ("plate", "amplitude_saturation", "clipped_drive", 0.5, 12.0, 0, [(0.0, 0.5)], "",
     "the amplifier's rails (2 um/s, unequal by b) clip the sine, and the plate answers to its fundamental",
     lambda m, s, b: dict(w=m.w * 0.5 * (clipped((z := m.w * s / (2 * UM)) / (1 + b)) + clipped(z / (1 - b))))),
    ("plate", "amplitude_saturation", "lossy_ceramic", 0.02, 20.0, 0, [(0.8, 2.5)], "",
     "the ceramic's loss grows by a power of the amplitude itself: w (1 + s (w/2 um)^n) is what was asked for",
     lambda m, s, n: dict(w=g.bisect(lambda w: w * (1 + s * (w / (2 * UM)) ** n) - m.w, 0 * m.w, m.w, 40))),
    ("plate", "resonance_detuning", "self_heating", 0.1, 30.0, 1, [(-0.4, 0.4), (80, 600)], "time",
     "the plate warms by its own vibration and cools in pauses, and its resonance moves with that",
     lambda m, s, x0, tau: off_peak(m, x0 + s * follow(m, driven(m), tau))),
    ("plate", "resonance_detuning", "split_peak", 3.0, 500.0, 0, [(-0.01, 0.002), (0.004, 0.012), (0.3, 0.8)],
     "narrow", "two neighbouring modes near the table's frequencies, the second weaker; s is their quality factor",
     lambda m, s, off, gap, b: dict(w=m.w * abs(1 / (1 + 1j * (x := 2 * s * (m.f / np.median(m.f) - 1 - off)))
                                                + b / (1 + 1j * (x - 2 * s * gap))) / (1 + b))),
    ("plate", "mode_shape", "free_edges", 0.03, 4.0, 0, [(4 * MM, 10 * MM), (-3 * MM, 3 * MM)], "position",
     "near field of free edges: amplitude grows exponentially towards both ends",
     lambda m, s, decay, x0: dict(w=m.w * (1 + s * (np.cosh((m.x - x0) / decay) - 1) / np.cosh(20 * MM / decay)))),
    ("plate", "mode_shape", "rocking_plate", 0.02, 1.5, 1, [(-1.2, 1.2)], "position",
     "rocking on an even stroke, at a phase b", lambda m, s, b: dict(w=m.w * abs(1 + s * np.exp(1j * b) * m.x / 0.02))),
    ("plate", "mode_shape", "actuator_patch", 0.03, 0.95, 0, [(-8 * MM, 8 * MM), (3 * MM, 9 * MM)], "position",
     "less amplitude over the glued actuator", lambda m, s, x0, n: dict(w=m.w * (1 - s / (1 + ((m.x - x0) / n) ** 8)))),
    ("readout", "force_crosstalk", "reciprocal_matrix", 5e-4, 0.25, 1, [(0.3, 1.2)], "",
     "a whole matrix left out: normal force in the lateral reading, and the reverse with the same sign",
     lambda m, s, b: read(m, lambda l, n: s * n, lambda l, n: b * s * l)),
    ("readout", "force_crosstalk", "slow_pad", 5e-4, 0.25, 1, [(0.15, 0.6)], "",
     "share of the normal force through a glued joint that still bears part of the pass before",
     lambda m, s, b: read(m, lambda l, n: s * ((1 - b) * n + b * last(n)))),
    ("readout", "lateral_offset_drift", "wandering_zero", 3e-4, 0.3, 1, [(0, 9999)], "time",
     "the zero wanders at random (Brownian), as an amplifier's does",
     lambda m, s, mark: read(m, lambda l, n: s * np.cumsum(
         chance(mark, len(m.t)) * np.sqrt(np.diff(m.t, prepend=m.t[0]) / m.t[-1])))),
    ("readout", "lateral_offset_drift", "hasty_tares", 2e-4, 0.1, 1, [(0, 9999), (0.5, 1.5)], "time runs",
     "tared before each run with an error by chance, over an even drift",
     lambda m, s, mark, b: read(m, lambda l, n: s * (chance(mark, m.run.max() + 1)[m.run] + b * m.t / m.t[-1]))),
    ("readout", "normal_offset", "trailing_cable", 1e-3, 0.06, 1, [(12 * MM, 40 * MM)], "position",
     "weight of a cable that trails along the stroke", lambda m, s, xc: read(m, None, lambda l, n: s * (1 + m.x / xc))),
    ("readout", "normal_offset", "settling_cell", 1e-3, 0.06, 1, [(1, 20), (0.1, 0.6)], "time runs",
     "offset of the normal force that creeps by the logarithm of the time since loading",
     lambda m, s, t0, b: read(m, None, lambda l, n: s * (b + (1 - b) * np.log1p(m.rt / t0) / np.log1p(300 / t0)))),
    ("readout", "plate_tilt", "rocking_foot", 5e-4, 0.2, 1, [(0.3, 1.0), (-6 * MM, 6 * MM)], "position",
     "the plate rocks on a foot as the finger passes over it: two angles with a soft change",
     lambda m, s, b, x0: tilt(m, s * (1 + b * np.tanh((m.x - x0) / (2 * MM))))),
    ("readout", "plate_tilt", "settling_wax", 5e-4, 0.2, 1, [(0.1, 0.5), (0.2, 0.7)], "time",
     "the wax under the plate creeps, and the angle settles in the course of the session",
     lambda m, s, n, b: tilt(m, s * (1 - b * np.exp(-m.t / m.t[-1] / n)))),
    ("speed", "speed_error", "cable_pull", 0.006, 0.8, 1, [(-0.5, 0.5)], "",
     "the cable helps one way and hinders the other: factor error by direction, about a common one",
     lambda m, s, b: pace(m, m.U * (1 + s * (m.way + b)))),
    ("speed", "speed_error", "loaded_motor", 5e-5, 4e-2, 0, [(0.7, 1.3)], "",
     "an open motor slows by the friction dragged", lambda m, s, n: pace(m, m.U - s * (m.mu * m.F / 0.2) ** n)),
    ("speed", "speed_ripple", "stage_resonance", 0.008, 1.2, 0, [(2 * MM, 6 * MM), (0, TAU), (10 * MM, 50 * MM)],
     "position", "ripple with the pitch, strong at the speed at which it meets the stage's own frequency",
     lambda m, s, pitch, phase, uc: pace(m, m.U * (1 + s * np.sin(TAU * m.x / pitch + phase)
                                                   / np.hypot(1 - (z := m.U / uc) ** 2, 0.8 * z)))),
    ("speed", "speed_ripple", "passing_balls", 0.015, 0.9, 0, [(1.5 * MM, 6 * MM), (0, TAU)], "position",
     "balls enter the nut one after another: cusps, |sin| less its mean",
     lambda m, s, pitch, phase: pace(m, m.U * (1 + 2 * s * (abs(np.sin(np.pi * m.x / pitch + phase)) - 2 / np.pi)))),
]


# ---------------------------------------------------------------------------------------------------------------------
# Strangers

STRANGER_TABLE = [
    ("glassy_keratin", "jump", HUMIDITY, 0.005, 0.8, [(0.3, 0.7)], "humidity",
     "friction jumps at a humidity", lambda m, s, q: s * (m.H > np.quantile(m.H, q))),
    ("coating_edge", "jump", "position_m", 0.005, 0.8, [(-8 * MM, 8 * MM)], "position",
     "a coating ends at a place", lambda m, s, x0: s * (m.x > x0)),
    ("buckling_pad", "jump", "normal_force_n", 0.005, 0.8, [(0.35, 0.65)], "fill",
     "the pad buckles at a load, and friction jumps", lambda m, s, q: s * (m.F > np.quantile(m.F, q))),
    ("chatter_band", "bump", "speed_m_s", 0.005, 1.2, [(0.25, 0.75), (0.06, 0.18)], "fill",
     "a narrow band of speeds in which the stage chatters (Lorentzian over the logarithm)",
     lambda m, s, q, n: s / (1 + (np.log(m.U / np.quantile(m.U, q)) / n) ** 2)),
    ("half_molten_lipid", "bump", "temperature_c", 0.005, 1.2, [(0.3, 0.7), (0.08, 0.2)], "temperature",
     "lipid is tacky only while it melts (sech^2, share of the range)",
     lambda m, s, q, n: s / np.cosh((m.T - np.quantile(m.T, q)) / (n * np.ptp(m.T))) ** 2),
    ("milled_lands", "period", "position_m", 0.005, 0.7, [(2 * MM, 7 * MM), (0, TAU)], "position",
     "lands and grooves (square wave)", lambda m, s, wave, phase: s * np.sign(np.sin(TAU * m.x / wave + phase))),
    ("air_conditioner", "period", "time_s", 0.005, 0.7, [(0.08, 0.2), (0, 1)], "time",
     "a machine that switches: sawtooth in time (share of the session)",
     lambda m, s, n, phase: s * (2 * ((m.t / m.t[-1] / n + phase) % 1) - 1)),
    ("hidden_mode", "resonance", "frequency_hz", 0.005, 0.9, [(0.3, 0.7), (0.008, 0.03), (0.7, 2)], "fill frequencies",
     "a lateral mode beside its antiresonance (Fano's line), when vibrated", lambda m, s, q, n, k: s * (m.w > 0) * (
         (k + (z := (m.f / np.quantile(m.f, q) - 1) / n)) ** 2 / (1 + z ** 2) - 1) / k ** 2),
    ("knotty_speed", "rough", "speed_m_s", 0.003, 0.5, [(0, 9999)], "fill",
     "straight lines between chance values at twelve speeds of the table",
     lambda m, s, mark: s * np.interp(np.log(m.U), np.log(np.quantile(m.U, np.linspace(0, 1, 12))), chance(mark, 12))),
    ("memory_of_speed", "memory", "speed_m_s", 0.003, 0.4, [(0.2, 0.8)], "",
     "the speeds of the two passes before leave their mark on the film of sebum",
     lambda m, s, b: s * np.log(last(m.U) / U0 * (last(last(m.U)) / U0) ** b)),
]

g.__doc__, g.ridge_march = __doc__, lambda m: m.ridge(m)
g.FORMS = [SimpleNamespace(**dict(zip("part cause name low high signed shapes needs meaning law".split(), row)))
           for row in FORM_TABLE]
g.CAUSES = sorted({form.cause for form in g.FORMS})
g.STRANGERS = [SimpleNamespace(part="stranger", cause="outside the library", signed=1, **dict(zip(
    "name structure covariate low high shapes needs meaning law".split(), row))) for row in STRANGER_TABLE]
# Faint targets are lifted (0.7 deviations a pass to about 0.93, 10 stay), so that four fifths of the singles are seen.
g.choose_size = lambda form, sign, target, chi2_of, other_way=True: SEARCH(
    form, sign, target * (1.4e4 / target) ** (0.1 * other_way), chi2_of, other_way)

if __name__ == "__main__":
    g.main()
