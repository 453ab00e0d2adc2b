#!/usr/bin/env python3
"""Labelled tables of a finger on a vibrating plate for `muprime diagnose`, sixth generator (numpy, SciPy).

usage: sixth_generator.py OUT --seed S [--singles 110] [--pairs 30] [--none 20] [--strangers 40]

Contact, designs, noise and files are those of fourth_generator.py, the search of the size that of
fifth_generator.py; the forms of all causes and the strangers are in neither. Each row names the paper, book
or data sheet that it follows. They were written without a look at muprime's models, so they measure the
diagnosis on forms to which nobody has fitted it. Names and units are those of the fourth generator; all
follows from the seed, the stratum and the index.
"""
from types import SimpleNamespace

import numpy as np
from scipy.integrate import cumulative_trapezoid
from scipy.special import exp1, jve
from scipy.stats import poisson

import fourth_generator as g
from fifth_generator import ONE_CHAIN, WHOLE, adhere, chance, consolidated, follow
from fourth_generator import F0, KHZ30, MM, P0, TAU, U0, UM, last, off_peak, pace, read, stiffen, tilt

HALF_STROKE = 20 * MM


# -----------------------------------------------------------------------------------------------------------
# Helpers of the forms

def sealed_pockets(m, s, depth, fc):
    """Pockets of air on an area s, compressed without exchange of heat; load makes them shallower."""
    e = m.w / (m.w + 2 * depth / (1 + m.F / fc))
    wave = np.cos(TAU * (np.arange(64) + 0.5) / 64)
    return g.bear(s * m.p / m.F * (((1 - np.outer(e, wave)) ** -1.4).mean(axis=1) - 1))


def slip_flow_disc(m, s, gap, radius, n):
    """Reynolds film of round patches whose air slips at the walls; the gap closes by a power of load."""
    gap = gap * (m.F / F0) ** -n
    slip = 1 + 6 * 68e-9 * P0 / m.p / gap
    z = np.sqrt(-12j * 1.8e-5 * TAU * m.f * radius ** 2 / (m.p * gap ** 2 * slip))
    trapped = 1 - (2 * jve(1, z) / (z * jve(0, z))).real
    return g.bear(1.25 * s * m.p / m.F * (m.w / (m.w + 2 * gap)) ** 2 * trapped)


def flows_back(y, tau):
    """A stretch that flows back by Eyring's sinh: quickly at first, exponentially below y."""
    start = lambda peak: np.minimum(np.tanh(peak / (2 * y)), 1 - 1e-12)
    return lambda peak, off: 2 * y * np.arctanh(start(peak) * np.exp(-off / tau))


def one_chain(m, mass, ratio, zeta):
    """The fourth's march of one mass a ridge, with the mass of each pass."""
    return ONE_CHAIN(SimpleNamespace(**{**vars(m), "ridge": (mass, ratio, zeta)}))


def spread_masses(s, spread, ratio, zeta):
    """Three classes of a lognormal spread of masses (points of Gauss and Hermite), marched side by side."""
    def march(m):
        wide = SimpleNamespace(**{name: np.tile(getattr(m, name), 3) for name in "w F U f kn kl mu".split()})
        masses = np.repeat(s * np.exp(spread * np.sqrt(3) * np.array([-1, 0, 1])), len(m.F))
        return np.array([1, 4, 1]) / 6 @ one_chain(wide, masses, ratio, zeta).reshape(3, -1)
    return dict(ridge=march)


def springpot(m, s, n):
    """Fractional Kelvin-Voigt tissue, k (1 + (i w tau)^n), whose storage stiffness is the rig's at 30 kHz."""
    storage, x = lambda z: 1 + z * np.cos(n * np.pi / 2), s * (m.f / KHZ30) ** n
    return dict(kn=m.kn * storage(x) / storage(s), loss=x * np.sin(n * np.pi / 2) / storage(x))


def drained(m, s, impulse):
    """Stefan's law of a film that is squeezed out: its thickness falls as (1 + impulse/J)^(-1/2)."""
    def law(time, normal, cycle):
        pressed = cumulative_trapezoid(normal, time, axis=1, initial=0) * (len(time) // len(m.U))
        return 1 - s / np.sqrt(1 + pressed / impulse)
    return dict(bonded=law)


def cavitating(m, s, b):
    """Viscous pull of a film of sweat (velocity, radius to the fourth), limited by cavitation at p."""
    viscous = m.w * m.f / 0.06 * (m.F / F0) ** (4 / 3)
    hollow = b * m.p / P0 * (m.F / F0) ** (2 / 3)
    return dict(pull=s * viscous * hollow / (viscous + hollow), more=lambda normal: 0 * normal)


def bursts(m, mark, fall):
    """Five bursts at chance passes: each rises in some ten seconds and fades with the time `fall`."""
    rng = np.random.default_rng(int(mark))
    since = np.maximum(m.t - m.t[rng.integers(0, len(m.t), 5)][:, None], 0)
    return rng.uniform(0.4, 1, 5) @ (np.exp(-since / fall) * -np.expm1(-since / 10))


def above(x, knee):
    """What x has beyond the knee, with an edge of the width `knee`; one at the largest."""
    z = np.logaddexp(0, x / knee)
    return z / z.max()


def duffing(m, s, b):
    """Amplitude of a hardening plate: w sqrt(1 + (b + s (w/2 um)^2)^2) is what was asked for."""
    asked = lambda w: w * np.hypot(1, b + s * (w / (2 * UM)) ** 2) / np.hypot(1, b)
    return dict(w=g.bisect(lambda w: asked(w) - m.w, 0 * m.w, m.w, 40))


def langevin(x):
    """Langevin's function per third of its argument."""
    x = np.maximum(x, 1e-2)
    return 3 / x * (1 / np.tanh(x) - 1 / x)


# -----------------------------------------------------------------------------------------------------------
# The forms, in rows like those of the fourth generator

FORM_TABLE = [
    ("normal", "squeeze_film", "sealed_pockets", 1e-8, 8e-5, 0, [(1.5 * UM, 6 * UM), (0.2, 1.0)], "",
     "adiabatic air in shallow grooves that load flattens (Cengel and Boles, Thermodynamics, 2015: p V^1.4)",
     sealed_pockets),
    ("normal", "squeeze_film", "slip_flow_disc", 1e-8, 2e-4, 0,
     [(1 * UM, 4 * UM), (0.3 * MM, 1.2 * MM), (0.05, 0.3)], "",
     "round film with slip at the walls (Griffin et al. 1966; Burgdorfer 1959); load closes the gap",
     slip_flow_disc),
    ("shear", "lateral_recovery", "fung_spectrum", 0.01, 1.0, 0, [(1e-6, 4e-6), (40e-6, 400e-6)], "",
     "quasi-linear tissue with a box of relaxation times (Fung, Biomechanics, 1993): difference of E1",
     lambda m, s, t1, t2: dict(kept=lambda peak, mean, off: s * peak / np.log(t2 / t1)
                               * (exp1((off + 1e-9) / t2) - exp1((off + 1e-9) / t1)))),
    ("shear", "lateral_recovery", "eyring_flow", 0.01, 1.0, 0, [(0.03 * UM, 0.3 * UM), (8e-6, 80e-6)], "",
     "stress-activated flow (Eyring 1936): large stretches flow back faster than small ones",
     lambda m, s, y, tau: dict(kept=lambda peak, mean, off: s * flows_back(y, tau)(peak, off))),
    ("ridge", "ridge_inertia", "spread_masses", 2e-6, 1.5e-4, 0, [(0.3, 0.8), (1.5, 4.0), (0.05, 0.3)], "",
     "ridges differ in breadth (Ohler and Cummins 1942), so masses have a lognormal spread",
     lambda m, *shapes: spread_masses(*shapes)),
    ("ridge", "ridge_inertia", "shear_wave_mass", 2e-6, 1.5e-4, 0, [(0.5, 1.2), (1.5, 4.0), (0.05, 0.3)],
     "frequencies", "the mass that moves along reaches as deep as a shear wave, f^-n (Oestreicher 1951)",
     lambda m, s, n, ratio, zeta: dict(ridge=lambda o: one_chain(o, s * (o.f / KHZ30) ** -n, ratio, zeta))),
    ("normal", "normal_damping", "springpot", 0.01, 4.0, 0, [(0.3, 0.8)], "",
     "fractional Kelvin-Voigt tissue (Bagley and Torvik 1983): both parts rise by a power", springpot),
    ("normal", "normal_damping", "warm_sebum", 5e-8, 8e-6, 0, [(40e3, 110e3)], "temperature",
     "dashpot of sebum, thinner when warm (Butcher and Coonin 1949; Arrhenius' law, energy in J/mol)",
     lambda m, s, energy: dict(loss=TAU * m.f * s * np.exp(energy / 8.314 * (1 / (m.T + 273) - 1 / 297)))),
    ("level", "load_dependent_friction", "ploughing_pad", 0.02, 2.0, 0, [(0.6, 1.0)], "",
     "ploughing loss F^(1/3) beside shear of the area F^(-1/3) (Greenwood and Tabor 1958; Adams et al. 2007)",
     lambda m, s, b: dict(mu=m.mu * np.maximum(
         1 - s + s * (b * (z := np.cbrt(m.F / F0)) + (1 - b) / z), 0.1))),
    ("level", "load_dependent_friction", "two_part_line", 0.02, 0.9, 1, [(0.12, 0.4)], "",
     "friction force over load is two straight lines that meet at a load (Tomlinson, Lewis and Carre 2009)",
     lambda m, s, fc: dict(mu=m.mu * (1 - 0.5 * s * ((d := 1 - fc / m.F) + np.hypot(d, 0.05))))),
    ("shear", "contact_ageing", "power_creep", 0.004, 0.4, 0, [(2e-7, 2e-6), (50e-6, 500e-6)], "",
     "static friction grows by a small power of contact time (Rabinowicz 1958; Brechet and Estrin 1994)",
     lambda m, s, t0, full: dict(
         bonded=lambda time, normal, cycle: np.minimum((time + t0) / (full + t0), 1) ** s)),
    ("shear", "contact_ageing", "drained_sweat", 0.02, 0.98, 0, [(1e-6, 12e-6)], "",
     "bare contact spreads as the impulse of each contact squeezes sweat out (Stefan 1874)", drained),
    ("level", "rate_dependent_friction", "eyring_film", 0.02, 0.9, 0, [(1 * MM, 30 * MM)], "",
     "shear stress of a boundary film as asinh of speed (Johnson and Tevaarwerk 1977)",
     lambda m, s, uc: dict(mu=m.mu * (1 + s * (np.arcsinh(m.U / uc) / np.arcsinh(U0 / uc) - 1)))),
    ("level", "rate_dependent_friction", "mixed_valley", 0.01, 0.9, 0, [(8 * MM, 25 * MM), (0.04, 0.2)], "",
     "Stribeck's valley: 1/(1 + (U/us)^2) and a viscous rise (Hess and Soom 1990)",
     lambda m, s, us, b: dict(mu=m.mu * (1 + s * (1 / (1 + (z := m.U / us) ** 2) + b * z - 0.4)))),
    ("normal", "adhesion", "kelvin_menisci", 3e-4, 0.2, 0, [(0.5, 1.5)], "humidity",
     "menisci of Kelvin's radius pull as 1/ln(1/humidity), by a power (Bocquet et al. 1998)",
     lambda m, s, n: adhere(a := s * (np.log(2) / np.log(100 / m.H)) ** n, a)),
    ("normal", "adhesion", "cavitating_sweat", 3e-3, 3.0, 0, [(0.3, 2.0)], "",
     "viscous pull of sweat on the rising finger until the film cavitates (Poivet et al. 2003)", cavitating),
    ("level", "moisture_drift", "fickian_occlusion", 0.02, 0.9, 1, [(300, 4000)], "time runs",
     "horny layer under the pad soaks by diffusion, root of time in a run first (Crank 1975)",
     lambda m, s, tau: dict(mu=m.mu * (1 + s * consolidated(m.rt / tau)))),
    ("level", "moisture_drift", "sudomotor_bursts", 0.02, 1.2, 0, [(0, 9999), (60, 350)], "time",
     "sweat glands fire in bursts, each with a steep rise and a slow return (Boucsein 2012)",
     lambda m, s, mark, fall: dict(mu=m.mu * (1 + s * bursts(m, mark, fall)))),
    ("level", "moisture_drift", "thermal_sweat", 0.01, 0.8, 1, [(0.2, 0.7)], "temperature time",
     "sweat rises in proportion to the warmth above a threshold (Nadel, Bullard and Stolwijk 1971)",
     lambda m, s, q: dict(mu=m.mu * (1 + s * above(m.T - np.quantile(m.T, q), 0.3)))),
    ("normal", "multi_asperity", "abbott_curve", 3e-8, 4e-6, 0, [(0.2, 1.0), (0.5, 3.0)], "",
     "bearing curve with reduced peaks, straight core and valleys, as of a honed face (ISO 13565-2:1996)",
     lambda m, s, b, n: dict(heights=s * (WHOLE - b * np.maximum(1 - WHOLE / 0.2, 0)
                                          + n * np.maximum(WHOLE / 0.75 - 1, 0)))),
    ("normal", "multi_asperity", "flake_layers", 3e-8, 3e-6, 0, [(0.6, 2.5)], "",
     "skin flakes are whole cells thick (Christophers and Kligman 1964): steps s, numbers of Poisson",
     lambda m, s, n: dict(heights=s * poisson.ppf(WHOLE, n))),
    ("stiffness", "subsurface_relaxation", "findley_creep", 0.05, 2.0, 1, [(0.15, 0.5), (0.4, 1.3)], "time",
     "creep by a power of time (Findley, Lai and Onaran 1976)",
     lambda m, s, n, b: stiffen(m, c := s * (m.t / m.t[-1]) ** n, b * c)),
    ("stiffness", "subsurface_relaxation", "preconditioning", 0.05, 2.0, 1, [(30, 200), (0.5, 1.3)], "time",
     "stiffness follows the loads of the last minutes (preconditioning of tissue, Fung 1993)",
     lambda m, s, tau, b: stiffen(m, c := s * (follow(m, m.F / F0, tau, 1.0) - 1), b * c)),
    ("stiffness", "stiffness_error", "cold_calibration", 0.2, 1.8, 1, [(0.2, 0.6)], "temperature",
     "calibrated cold: off by exp(s), softer as it warms (Ferry, Viscoelastic Properties of Polymers, 1980)",
     lambda m, s, n: stiffen(m, c := s - n * abs(s) * (m.T - m.T[0]) / 5, c)),
    ("stiffness", "stiffness_error", "pad_angle", 0.1, 1.6, 1, [(0.2, 0.5), (0.4, 1.2)], "position",
     "the finger flexes along the stroke, and pulp is stiffer near the nail (Serina, Mote and Rempel 1997)",
     lambda m, s, n, b: stiffen(m, c := s * (1 + n * m.x / HALF_STROKE), b * c)),
    ("plate", "amplitude_miscalibration", "averaging_filter", 0.05, 0.65, 0, [], "frequencies",
     "a triangulation sensor averages over s/30 kHz, so its gain is a sinc (Keyence LK-G5000, user's manual)",
     lambda m, s: dict(w=m.w / np.sinc(s * m.f / KHZ30))),
    ("plate", "amplitude_miscalibration", "log_detector", 0.05, 1.5, 0, [(11, 15), (0, TAU)], "",
     "logarithmic detector whose error ripples with its stages, s in dB (Analog Devices, AD8307 data sheet)",
     lambda m, s, n, phase: dict(w=m.w * 10 ** (s / 20 * np.sin(
         TAU * 20 * np.log10(np.maximum(m.w, 1e-9) / UM) / n + phase)))),
    ("plate", "amplitude_droop", "modal_loading", 0.02, 15.0, 0, [(8 * MM, 25 * MM), (-8 * MM, 8 * MM)],
     "position", "the finger damps a mode by the square of its shape at x (Ewins, Modal Testing, 2000)",
     lambda m, s, wave, x0: dict(w=m.w / (1 + s * m.F * np.cos(np.pi * (m.x - x0) / wave) ** 2))),
    ("plate", "amplitude_droop", "railed_controller", 0.1, 15.0, 0, [(1.1, 1.5)], "",
     "control holds the amplitude until its voltage ends (Wiertlewski, Fenton Friesen and Colgate 2016)",
     lambda m, s, room: dict(w=m.w * (1 + (m.w / m.w.max() * (1 + s * m.F) / room) ** 8) ** (-1 / 8))),
    ("plate", "amplitude_saturation", "duffing_plate", 0.05, 15.0, 0, [(0.0, 0.8)], "",
     "a hardening plate leaves its resonance as it swings further (Nayfeh and Mook 1979)", duffing),
    ("plate", "amplitude_saturation", "langevin_ceramic", 0.4, 25.0, 0, [(0.0, 0.5)], "",
     "domains of the ceramic align by Langevin's law, beside a part b that does not (Smith and Hom 1999)",
     lambda m, s, b: dict(w=m.w * (b + (1 - b) * langevin(s * m.w / (2 * UM))))),
    ("plate", "amplitude_saturation", "transformer_core", 0.2, 6.0, 0, [(0.8, 1.2)], "",
     "core of the output transformer saturates by volts per hertz, tanh (McLyman, Transformer Design, 2011)",
     lambda m, s, n: dict(w=m.w * np.tanh(
         z := np.maximum(s * m.w / (2 * UM) * (KHZ30 / m.f) ** n, 1e-6)) / z)),
    ("plate", "resonance_detuning", "clamped_anew", 0.2, 10.0, 1, [(0, 9999), (0.0, 0.8)], "runs",
     "clamped again before each run, and the bolt's torque moves the resonance (Arnold and Muehlen 2001)",
     lambda m, s, mark, b: off_peak(m, s * (b + chance(mark, m.run.max() + 1)[m.run]))),
    ("plate", "resonance_detuning", "lagging_tracker", 0.1, 40.0, 1, [(40, 250), (-0.3, 0.3)],
     "temperature time", "a slow loop lags behind the warming plate (Gardner, Phaselock Techniques, 2005)",
     lambda m, s, tau, x0: off_peak(m, x0 + s * (m.T - follow(m, m.T, tau, m.T[0])))),
    ("plate", "mode_shape", "damped_from_one_end", 0.05, 0.97, 0, [(6 * MM, 30 * MM)], "position",
     "a bending wave decays away from the actuator at one end (Cremer, Heckl and Petersson 2005)",
     lambda m, s, decay: dict(w=m.w * (1 - s + s * np.exp(-(m.x + HALF_STROKE) / decay)))),
    ("plate", "mode_shape", "beating_modes", 0.02, 0.95, 0,
     [(7 * MM, 14 * MM), (1.2, 1.6), (-8 * MM, 8 * MM)], "position",
     "two modes of nearly equal frequency mix, as in nearly square plates (Leissa 1969)",
     lambda m, s, wave, b, x0: dict(w=m.w * (1 + 0.5 * s * (
         np.cos(z := TAU * (m.x - x0) / wave) + np.cos(z / b))))),
    ("readout", "force_crosstalk", "ball_seat", 5e-4, 0.25, 1, [(0.3, 0.7)], "",
     "the cell's balls approach by a power of load below one (Johnson, Contact Mechanics, 1985)",
     lambda m, s, b: read(m, lambda l, n: s * F0 * (np.maximum(n, 0) / F0) ** b)),
    ("readout", "force_crosstalk", "loosened_joint", 5e-4, 0.25, 1, [(0.4, 0.95), (0.4 * UM, 1.5 * UM)], "",
     "share of the normal force through a screwed joint, which vibration frees (Junker 1969)",
     lambda m, s, b, wc: read(m, lambda l, n: s * n * (1 - b * m.w ** 2 / (m.w ** 2 + wc ** 2)))),
    ("readout", "lateral_offset_drift", "knocked_cell", 5e-4, 0.2, 1, [(0.2, 0.7), (0.3, 1.0)], "time",
     "zero jumps at an overload and recovers in part (Interface Inc., Load Cell Field Guide)",
     lambda m, s, q, b: read(m, lambda l, n: s * ((z := m.t / m.t[-1] - q) > 0)
                             * (b + (1 - b) * np.exp(-abs(z) / 0.1)))),
    ("readout", "lateral_offset_drift", "apparent_strain", 5e-4, 0.15, 1, [(-0.5, 0.5)], "temperature",
     "a compensated bridge is left with a parabola and cubic over temperature (Vishay, Tech Note TN-504)",
     lambda m, s, b: read(m, lambda l, n: s * (
         (z := 2 * (m.T - m.T.min()) / np.ptp(m.T) - 1) ** 2 + b * z ** 3))),
    ("readout", "lateral_offset_drift", "moist_gauges", 5e-4, 0.15, 1, [(200, 2000), (0.0, 0.5)],
     "humidity time", "gauges' glue takes up water, zero follows the air with a lag (Hoffmann, HBM, 1989)",
     lambda m, s, tau, b: read(m, lambda l, n: s * (b + (follow(m, m.H, tau, m.H[0]) - m.H[0]) / 10))),
    ("readout", "normal_offset", "rectified_vibration", 1e-3, 0.06, 1, [(-0.3, 0.5)], "",
     "the cell reads a mean force from the square of the plate's acceleration (IEEE Std 1293, rectification)",
     lambda m, s, b: read(m, None, lambda l, n: s * (
         b + (1 - abs(b)) * (z := (m.w * m.f ** 2) ** 2) / z.max()))),
    ("readout", "normal_offset", "sticking_guide", 1e-3, 0.06, 1, [(-0.4, 0.4)], "",
     "dry friction of a guide bears a force by the sense of the last change of load (Slocum 1992)",
     lambda m, s, b: read(m, None, lambda l, n: s * (b + (1 - abs(b)) * np.tanh((m.F - last(m.F)) / 0.05)))),
    ("readout", "plate_tilt", "bent_by_finger", 5e-4, 0.2, 1, [(-0.5, 0.5)], "position",
     "slope of a supported plate under the finger, load times x (1 - (x/30 mm)^2) (Young and Budynas 2002)",
     lambda m, s, b: tilt(m, s * (b + 2.6 * m.F / F0 * (z := m.x / (30 * MM)) * (1 - z ** 2)))),
    ("readout", "plate_tilt", "bimetal_plate", 5e-4, 0.2, 1, [(0.0, 1.0)], "temperature",
     "a glued actuator bends the plate with warmth (Timoshenko 1925, bi-metal thermostats)",
     lambda m, s, b: tilt(m, s * (b + (m.T - m.T[0]) / 4))),
    ("speed", "speed_error", "short_run_up", 0.01, 8.0, 0, [(0.5, 1.0)], "position",
     "a stroke starts at rest, and speed is not reached near its start (trapezoid of motion, Ellis 2012)",
     lambda m, s, n: pace(m, m.U * (1 + s * (m.U / 0.05) ** 2 / (2 + m.way * m.x / (10 * MM))) ** -n)),
    ("speed", "speed_error", "divided_clock", 0.05, 1.6, 0, [(0.9, 1.1)], "",
     "a stepper's pulses are whole counts of a timer, coarse at high speed (Atmel, application note AVR446)",
     lambda m, s, n: pace(m, (clock := 0.08 * n / s) / np.maximum(np.round(clock / m.U), 1))),
    ("speed", "speed_error", "stiff_grease", 0.02, 0.85, 0, [(40, 400)], "time runs",
     "grease slows an open drive until it is worked soft in each run (Lugt, Grease Lubrication, 2013)",
     lambda m, s, tau: pace(m, m.U * (1 - s * np.exp(-m.rt / tau)))),
    ("speed", "speed_ripple", "two_pulleys", 0.015, 0.5, 0,
     [(2 * MM, 6 * MM), (1.3, 1.9), (0, TAU), (0, TAU)], "position",
     "two eccentric pulleys of unlike size beat (Gates, Precision Drive Design Manual)",
     lambda m, s, pitch, b, phase, other: pace(m, m.U * (1 + s * (np.sin(z := TAU * m.x / pitch + phase)
                                                                  + 0.7 * np.sin(z / b + other))))),
    ("speed", "speed_ripple", "cardan_joint", 0.1, 1.0, 0, [(2.5 * MM, 8 * MM), (0, TAU)], "position",
     "Hooke's joint at the angle s: cos s/(1 - sin^2 s cos^2(turn)) (Norton, Design of Machinery, 2012)",
     lambda m, s, turn, phase: pace(m, m.U * np.cos(s) / (
         1 - (np.sin(s) * np.cos(TAU * m.x / turn + phase)) ** 2))),
    ("speed", "speed_ripple", "jerking_slide", 0.02, 1.5, 0, [(2 * MM, 6 * MM), (0, 1), (10 * MM, 50 * MM)],
     "position", "a slide sticks and slips at slow speed: sawtooth, fading with speed (Rabinowicz 1995)",
     lambda m, s, pitch, phase, uc: pace(m, m.U * (1 + s * np.exp(-m.U / uc)
                                                   * (2 * ((m.x / pitch + phase) % 1) - 1)))),
]


# -----------------------------------------------------------------------------------------------------------
# Strangers

STRANGER_TABLE = [
    ("atomised_sweat", "jump", "amplitude_pp_m", 0.005, 0.8, [(0.35, 0.65)], "fill",
     "beyond an amplitude a liquid film is thrown off as mist (Lang 1962)",
     lambda m, s, q: s * (m.w > np.quantile(m.w[m.w > 0], q))),
    ("torn_coating", "jump", "time_s", 0.005, 0.8, [(0.3, 0.7)], "time",
     "a coating tears off at a time (Holmberg and Matthews, Coatings Tribology, 2009)",
     lambda m, s, q: s * (m.t > np.quantile(m.t, q))),
    ("coffee_ring", "bump", "position_m", 0.005, 1.2,
     [(-6 * MM, 6 * MM), (3 * MM, 7 * MM), (0.8 * MM, 1.6 * MM)], "position",
     "the rim that a dried drop leaves (Deegan et al. 1997), crossed twice",
     lambda m, s, x0, radius, n: s * np.exp(-((abs(m.x - x0) - radius) / n) ** 2)),
    ("wiped_plate", "bump", "time_s", 0.005, 1.2, [(0.2, 0.7), (40, 160)], "time",
     "alcohol of a wipe lubricates until it has evaporated (Bird, Stewart and Lightfoot 2002)",
     lambda m, s, q, tau: s * ((z := m.t - np.quantile(m.t, q)) > 0) * np.exp(-abs(z) / tau)),
    ("hood_echo", "period", "frequency_hz", 0.005, 0.7, [(1.3e3, 3.5e3), (0, TAU)], "fill frequencies",
     "sound between plate and hood: a comb over frequency, when vibrated (Kinsler et al. 2000)",
     lambda m, s, comb, phase: s * (m.w > 0) * np.sin(TAU * m.f / comb + phase)),
    ("compressor_bursts", "period", "time_s", 0.005, 0.7, [(0.08, 0.2), (0, TAU), (2, 6)], "time",
     "a compressor blows oil mist while it fills its tank (Atlas Copco, Compressed Air Manual): pulses",
     lambda m, s, n, phase, k: s * np.exp(k * (np.cos(TAU * m.t / m.t[-1] / n + phase) - 1))),
    ("ridge_passing", "resonance", "speed_m_s", 0.005, 1.0, [(0.5, 0.85), (0.08, 0.18), (0.3, 0.8)], "fill",
     "ridges meet a texture at a resonance of the finger, and at half the speed (Wandersman et al. 2011)",
     lambda m, s, q, n, b: s * (1 / (1 + ((z := np.log(m.U / np.quantile(m.U, q))) / n) ** 2)
                                + b / (1 + ((z + np.log(2)) / n) ** 2))),
    ("patchy_wear", "rough", "position_m", 0.003, 0.5, [(0, 9999)], "position",
     "sixteen patches of unlike wear with sharp edges (Stachowiak and Batchelor 2013)",
     lambda m, s, mark: s * chance(mark, 16)[np.clip(((m.x / HALF_STROKE + 1) * 8).astype(int), 0, 15)]),
    ("own_track", "memory", "position_m", 0.003, 0.8, [(3 * MM, 8 * MM)], "position",
     "a transfer film near the place of the pass before (Briscoe 1981)",
     lambda m, s, reach: s * np.exp(-abs(m.x - last(m.x)) / reach)),
    ("turned_stroke", "memory", "direction", 0.003, 0.4, [(0.0, 0.5)], "",
     "skin sheared one way by the stroke before resists a reversal otherwise (Mindlin and Deresiewicz 1953)",
     lambda m, s, b: s * (m.way * last(m.way) + b * m.way * last(last(m.way)))),
]

# The import of the fifth generator has set the scaffold's march of ridges and its search of the size.
g.__doc__ = __doc__
g.FORMS = [SimpleNamespace(**dict(zip(
    "part cause name low high signed shapes needs meaning law".split(), row))) for row in FORM_TABLE]
g.CAUSES = sorted({form.cause for form in g.FORMS})
g.STRANGERS = [SimpleNamespace(part="stranger", cause="outside the library", signed=1, **dict(zip(
    "name structure covariate low high shapes needs meaning law".split(), row))) for row in STRANGER_TABLE]

if __name__ == "__main__":
    g.main()
