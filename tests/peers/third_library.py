"""How far a form of third_generator.py is from the library: the library's laws, written once more, fitted to
noise-free forces.

`distance` is the root of the chi2 that the best law of the cause's name leaves of the noise-free training rows, over
that of the recalibrated baseline. Both have stiffnesses and mu0 free under their priors; the law also has its sizes and
shapes. It is 0 for the library's own formula, 1 where no law explains anything. A fit starts at the best two of random
sizes and shapes, so a distance is an upper bound.
"""
from types import SimpleNamespace

import numpy as np
from scipy.optimize import least_squares
from scipy.special import j0
from third_generator import ARC, COLUMNS, HALF, THETA, bisect, bounce, deviations, evaluate, recalibrated, rows, turning

LAWS = {}
SCANNED, STARTS, EVALUATIONS, TOGETHER = 40, 2, 14, 80
INERTIA_PASSES, INERTIA_TRIES = 36, 40


def law(name, *parameters):
    """Registers a law: each parameter is (low, high), on a logarithmic scale where low is far below high."""
    def add(act):
        LAWS.setdefault(name, []).append((act, parameters))
        return act
    return add


def exponent_of_lift(c, d, lift, aw, af, al, b, ap):
    x = lift * (d.p / 101325) ** ap * (c.w / d.w_top) ** aw * (c.f / d.f_ref) ** af * (d.F_ref / c.F) ** al
    return np.where(b < 1e-6, np.exp(-x), (1 + np.maximum(b, 1e-6) * x) ** (-1 / np.maximum(b, 1e-6)))


POWERS = ((0.02, 200), (0.8, 5), (-2, 3), (-0.5, 2.5), (0, 2), (0.5, 2))
SOLID, AIR = 1.1, 3.4


def gap_share(c, a, film, solid, b, finite):
    """Share left to solid contact of a gap that asperities and film hold open together."""
    rest = np.maximum(np.log(solid / c.F), 0.2)
    b = np.maximum(b, 1e-6)
    start = np.expm1(b * rest) / b
    carried = lambda u: ((1 + b * start) / (1 + b * u)) ** (1 / b)

    def over(u):
        e2 = np.minimum(a / u, 0.95) ** 2 if finite else (a / u) ** 2
        lift = np.sqrt((1 + 1.5 * e2) / (1 - e2)) - 1 if finite else 1.25 * e2
        return 1 - carried(u) - film / c.F * lift
    return np.minimum(carried(bisect(start, start + 60, over)), 1)


@law("squeeze_film", (2e4, 4e6))
def _(c, d, s):
    c.F = c.F * gap_share(c, np.maximum(s * c.w / 2, 1e-9), AIR * d.p / 101325 * d.F_ref / 0.3, SOLID * d.F_ref
                          / 0.3, 0.0, False)


@law("squeeze_film", (2e4, 4e6), (0.05, 5), (0.4, 3), (0, 0.6))
def _(c, d, s, area, solid, b):
    c.F = c.F * gap_share(c, np.maximum(s * c.w / 2, 1e-9), area * AIR * d.p / 101325 * d.F_ref / 0.3, solid
                          * d.F_ref / 0.3, b, True)


@law("squeeze_film", *POWERS)
def _(c, d, *theta):
    c.F = c.F * np.maximum(exponent_of_lift(c, d, *theta), 1e-6)


@law("squeeze_film", *POWERS)
def _(c, d, *theta):
    c.factor = exponent_of_lift(c, d, *theta)


@law("lateral_recovery", (1, 3000), (1e-9, 3e-6))
def _(c, d, inverse, knee):
    def fall(x, dt):
        y = np.maximum(x / c.kl, 0)
        return c.kl * y / (1 + dt / inverse / (y + knee))
    c.march = (fall, lambda x, before, top, drag, dt: fall(x, dt))


def relaxing(c, tau, growth):
    """A rate that is one in `tau` at 0.1 um, of which a share goes in proportion to the stretch."""
    slow, unit = tau / (1 - growth), growth / ((1 - growth) * 1e-7 * c.kl)

    def fall(x, dt):
        kept = np.exp(-dt / slow)
        return x * kept / (1 + unit * (1 - kept) * np.maximum(x, 0))
    return fall


@law("lateral_recovery", (3e-7, 1e-3), (0, 0.99))
def _(c, d, tau, growth):
    fall = relaxing(c, tau, growth)
    c.march = (fall, lambda x, before, top, drag, dt: top + fall(x - top, dt))


@law("lateral_recovery", (3e-7, 1e-3), (0, 0.99))
def _(c, d, tau, growth):
    fall = relaxing(c, tau, growth)

    def drawn(x, before, top, drag, dt):
        added = drag - (top - before) + np.minimum(x - before, 0)
        return top + fall(np.maximum(x - before, 0), dt) - added * np.expm1(-dt / tau) * tau / dt
    c.march = (fall, drawn)


def retarded(c, a, tau):
    """Kelvin-Voigt: the skin leaves where the force ends, recovers with its time, and meets the plate again."""
    lag = np.maximum(2 * np.pi * c.f * tau, 1e-4)
    reach, late, load = np.hypot(1, lag), np.arctan(lag), c.F / (c.kn * a)

    def ends(depth):
        last = np.arccos(np.clip(-depth / reach, -1, 1)) - late
        left = np.cos(last) + depth
        gap = lambda x: np.cos(x) + depth - left * np.exp(-np.maximum(x - last, 0) / lag)
        first = bisect(np.maximum(last, np.pi), np.full(len(a), 2 * np.pi), gap, 30) - 2 * np.pi
        whole = depth >= reach
        return np.where(whole, -np.pi, first), np.where(whole, np.pi, last)

    def over(depth):
        first, last = ends(depth)
        part = lambda x: np.sin(x) + depth * x + lag * np.cos(x)
        return (part(last) - part(first)) / (2 * np.pi) - load

    depth = np.where(load >= reach, load, bisect(-reach, reach, over, 34))
    first, last = ends(depth)
    angle = first[:, None] + np.pi + THETA
    force = np.cos(angle) + depth[:, None] - lag[:, None] * np.sin(angle)
    return (c.kn * a)[:, None] * np.where(angle < last[:, None], np.maximum(force, 0), 0)


def plate_speed(c, d):
    """Peak speed of the plate over that of the largest amplitude at the reference frequency."""
    return np.clip(c.w * c.f / (d.w_top * d.f_ref), 0.05, 2)


@law("normal_damping", (3e-8, 1e-4), (-1, 1.5))
def _(c, d, tau, e):
    c.press = lambda c, a: retarded(c, a, tau * plate_speed(c, d) ** e)


@law("normal_damping", (0.02, 10), (-1, 1.5))
def _(c, d, loss, e):
    c.press = lambda c, a: retarded(c, a, loss / (2 * np.pi * c.f) * plate_speed(c, d) ** e)


@law("normal_damping", (0.02, 10), (3e-7, 5e-5))
def _(c, d, share, tau):
    x = 2 * np.pi * c.f * tau
    storage = 1 + share * x**2 / (1 + x**2)
    c.kn = c.kn * storage
    c.press = lambda c, a: retarded(c, a, share * tau / (1 + x**2) / storage)


@law("load_dependent_friction", (-0.6, 0.4))
def _(c, d, e):
    e = np.asarray(e).reshape(-1, 1)
    c.limit = lambda c, q, age: c.mu[:, None] * q * np.maximum(q / d.F_ref, 1e-6) ** e


@law("load_dependent_friction", (-0.8, 0.6))
def _(c, d, e):
    c.mu = c.mu * (c.F / d.F_ref) ** e


@law("load_dependent_friction", (-0.6, 8))
def _(c, d, k):
    k = k * d.F_ref
    c.mu = c.mu * np.maximum(1 + k, 0.05) / np.maximum(1 + k * c.F / d.F_ref, 0.05)


def contact_time(c):
    """Time of contact in a cycle; infinite where it never ends."""
    load = c.F / (c.kn * np.maximum(c.w / 2, 1e-13))
    return np.where(load >= 1, np.inf, np.interp(load, ARC, HALF) / (np.pi * c.f))


@law("contact_ageing", (5e-8, 1e-3))
def _(c, d, tau):
    c.limit = lambda c, q, age: c.mu[:, None] * q * -np.expm1(-age / np.asarray(tau).reshape(-1, 1))


@law("contact_ageing", (5e-8, 1e-3))
def _(c, d, tau):
    c.limit = lambda c, q, age: c.mu[:, None] * q * -np.expm1(-np.sqrt(age / np.asarray(tau).reshape(-1, 1)))


@law("contact_ageing", (5e-8, 1e-3), (0.1, 1))
def _(c, d, tau, share):
    c.mu = c.mu * (1 - share * tau / (contact_time(c) + tau))


@law("rate_dependent_friction", (-0.6, 0.8))
def _(c, d, e):
    c.mu = c.mu * (c.U / 0.02) ** e


@law("rate_dependent_friction", (-0.8, 3), (2e-3, 0.2), (0, 0.6))
def _(c, d, s, u, e):
    c.mu = c.mu * (1 + s * np.exp(-((c.U * (c.F / d.F_ref) ** -e / u) ** 2)))


@law("rate_dependent_friction", (-0.4, 0.6))
def _(c, d, s):
    c.mu = c.mu * np.maximum(1 + s * np.log(c.U / 0.02), 0.05)


@law("rate_dependent_friction", (-0.6, 0.8), (-5, 5), (-3, 3), (0, 0.6))
def _(c, d, s, bend, more, e):
    x = np.log(c.U / 0.02 * (c.F / d.F_ref) ** -e)
    c.mu = c.mu * np.exp(np.clip(s * x * (1 + x * (bend + x * more)), -2, 2))


@law("adhesion", (1e-3, 1))
def _(c, d, fa):
    fa = np.broadcast_to(fa, c.w.shape)
    def press(c, a):
        def force(depth):
            q = c.kn[:, None] * (a[:, None] * np.cos(turning((depth + fa / c.kn) / a)) + depth[:, None])
            return np.where(q > -fa[:, None], q + fa[:, None], 0)
        # The loaded branch: the largest depth at which contact and pull together carry the load.
        return force(bisect(-a, a + 2 * (c.F + fa) / c.kn, lambda x: (force(x) - fa[:, None]
                                                            * (force(x) > 0)).mean(1) - c.F, 40))
    c.press = press


@law("adhesion", (1e-3, 1), (1e-8, 1e-5))
def _(c, d, fa, tau):
    touching = np.minimum(contact_time(c) * c.f, 1)
    times = touching / (tau * c.f)
    c.mu = c.mu * (1 + fa * np.where((c.w > 0) & (touching < 1), touching * (1 + np.expm1(-times) / times), 1) / c.F)


@law("adhesion", (1e-3, 1), (4e-3, 0.4), (-0.4, 0.4))
def _(c, d, fa, scale, e):
    force = np.asarray(fa * (c.U / np.exp(np.log(d.U).mean())) ** e).reshape(-1, 1)
    scale = np.asarray(scale).reshape(-1, 1)
    c.limit = lambda c, q, age: c.mu[:, None] * np.where(q > 0, q + force * q / (q + scale), 0)


@law("adhesion", (2e-4, 0.5))
def _(c, d, fc):
    fc = np.asarray(fc).reshape(-1, 1)
    c.limit = lambda c, q, age: c.mu[:, None] * np.where(q > 0, q + 2 * fc + 2 * np.sqrt(fc * (q + fc)), 0)


@law("adhesion", (1e-3, 1), (2e-8, 1e-5))
def _(c, d, fa, reach):
    half = np.maximum(c.w, 1e-12) / 2

    def over(load):
        lift_off = np.cos(np.interp(load / c.kn / half, ARC, HALF))
        gap = np.maximum(lift_off[:, None] - np.cos(THETA), 0) * half[:, None]
        return load - c.F - fa * (1 / (1 + gap / reach) ** 2).mean(1)
    c.F = bisect(c.F, c.F + fa, over, 30)


def drifting(time, log, softens=0.0):
    """A change of mu0 over a time, by an exponential or a logarithm."""
    def act(c, d, s, tau):
        t = getattr(d, time)
        factor = np.maximum(1 + s * (np.log1p(t / tau) if log else -np.expm1(-t / tau)), 0.05)
        c.mu, c.kn, c.kl = c.mu * factor, c.kn * factor**softens, c.kl * factor**softens
    return act


law("moisture_drift", (-0.8, 9), (2, 3000))(drifting("t", False))
law("moisture_drift", (-0.6, 5), (2, 3000))(drifting("t", False, -0.5))
law("moisture_drift", (-0.2, 2), (2, 3000))(drifting("t", True))
law("moisture_drift", (-0.8, 9), (2, 3000))(drifting("trun", False))

MEDIANS = {
    "gaussian": (-1.593, -0.967, -0.589, -0.282, 0.0, 0.282, 0.589, 0.967, 1.593),
    "exponential": (-0.905, -0.780, -0.637, -0.470, -0.268, -0.018, 0.319, 0.830, 1.928),
    "even": (-1.540, -1.155, -0.770, -0.385, 0.0, 0.385, 0.770, 1.155, 1.540)}
for _nodes in MEDIANS.values():
    def _heights(c, d, sd, nodes=_nodes):
        sd = np.broadcast_to(sd, c.w.shape)
        c.heights = [(1 / 9, sd, k) for k in nodes]
    law("multi_asperity", (1e-8, 6e-6))(_heights)


@law("multi_asperity", (1e-8, 1.2e-5), (0.1, 0.9))
def _(c, d, step, low):
    step = np.broadcast_to(step, c.w.shape)
    c.heights = [(1 - low, step, 0.0), (low, step, -1.0)]


def creeping(log, both):
    """A change of stiffness over time, of which a share starts again in each run."""
    def act(c, d, s, tau, in_run=0.0, power=1.0):
        t = d.t + in_run * (d.trun - d.t)
        share = np.log1p(t / tau) if log else -np.expm1(-((t / tau) ** power))
        factor = np.maximum(1 + s * share, 0.05)
        c.kn, c.kl = c.kn * factor, c.kl * (factor if both else 1)
    return act


law("subsurface_relaxation", (-0.8, 4), (1, 3000), (0, 1))(creeping(False, True))
law("subsurface_relaxation", (-0.15, 1.5), (0.3, 1000))(creeping(True, True))
law("subsurface_relaxation", (-0.8, 4), (1, 3000))(creeping(False, False))
law("subsurface_relaxation", (-0.15, 1.5), (0.3, 1000))(creeping(True, False))
law("subsurface_relaxation", (-0.8, 4), (1, 3000), (0, 1), (0.25, 1.5))(creeping(False, False))


def stiffer(normal, lateral):
    def act(c, d, s):
        c.kn, c.kl = c.kn * np.exp(normal * s), c.kl * np.exp(lateral * s)
    return act


for _pair in ((0, 1), (1, 0), (1, 1)):
    law("stiffness_error", (-2, 2))(stiffer(*_pair))


@law("stiffness_error", (-2, 2), (-1, 1), (-1, 1))
def _(c, d, s, growth, lateral):
    s = s * (1 + growth * np.log(c.F / d.F_ref))
    c.kn, c.kl = c.kn * np.exp(s), c.kl * np.exp(s * (1 + lateral))


@law("stiffness_error", (-0.7, 1))
def _(c, d, power):
    c.kn, c.kl = c.kn * (c.F / d.F_ref) ** power, c.kl * (c.F / d.F_ref) ** power


@law("amplitude_miscalibration", (-1.5, 1.5))
def _(c, d, s):
    c.w = c.w * np.exp(s)


@law("amplitude_miscalibration", (-1e-6, 1e-6))
def _(c, d, missing):
    c.w = np.where(c.w > 0, np.maximum(c.w - missing, 0), 0)


@law("amplitude_droop", (0.01, 3), (0.2, 2.5))
def _(c, d, s, e):
    c.w = c.w / (1 + s * (c.F / d.F_ref) ** e)


@law("amplitude_droop", (0.01, 3))
def _(c, d, s):
    c.w = c.w * np.maximum(1 - s * c.F, 0.02)


@law("amplitude_saturation", (3e4, 5e6), (0.7, 20), (-1, 2), (0.3, 3.5))
def _(c, d, s, n, e, fold):
    x = np.maximum(s * c.w * (c.f / d.f_ref) ** e, 1e-9)
    c.w = c.w * np.exp(-fold * np.logaddexp(0, n * np.log(x)) / n)


@law("amplitude_saturation", (3e4, 5e6))
def _(c, d, s):
    x = np.maximum(s * c.w, 1e-9)
    c.w = c.w * np.tanh(x) / x


@law("resonance_detuning", (0.01, 5), (-20, 20), (-20, 20))
def _(c, d, s, point, soft):
    c.w = c.w / np.hypot(1, s * (d.T - d.T[0] - point + soft * (c.w / d.w_top) ** 2))


@law("resonance_detuning", (0.1, 12), (0.1, 5), (-2, 2), (-3, 3), (0.12, 8), (0, 1))
def _(c, d, s, tau, point, soft, steep, in_run):
    t = d.t + in_run * (d.trun - d.t)
    off = s * (-np.expm1(-t / d.duration / tau) - point + soft * (c.w / d.w_top) ** 2)
    c.w = c.w / (1 + off**2 / steep) ** (steep / 2)


@law("resonance_detuning", (0.1, 12), (0.1, 5))
def _(c, d, s, tau):
    c.w = c.w / np.hypot(1, s * np.expm1(-d.t / d.duration / tau))


@law("resonance_detuning", (1, 600), (0.7, 1.4))
def _(c, d, q, place):
    r = c.f / (d.f_ref * place)
    c.w = c.w / np.hypot(1, q * (r - 1 / r))


@law("resonance_detuning", (0.02, 8), (0.1, 5))
def _(c, d, s, tau):
    c.w = c.w / (1 - s * np.expm1(-d.t / d.duration / tau))


@law("mode_shape", (0.03, 1), (0.004, 0.03), (-0.25, 1.25), (0, 1), (0.2, 1.5), (-1, 1), (-4, 4))
def _(c, d, depth, spacing, phase, e, sharp, over, edge):
    shorter = (c.f / d.f_ref) ** e
    s = np.sin(np.pi * (d.x * shorter / spacing + phase + edge * (shorter - 1)))
    c.w = c.w * np.maximum(1 - depth * s**2, 4e-4) ** sharp * np.exp(depth * over)


@law("mode_shape", (50, 4e4), (-1, 2))
def _(c, d, fall, centre):
    c.w = c.w / (1 + fall * (d.x - centre * 0.036) ** 2)


@law("mode_shape", (0.03, 1), (0.004, 0.03), (-1, 2), (0, 1), (-1, 1))
def _(c, d, depth, spacing, centre, e, over):
    ring = j0(np.pi * (d.x - centre * 0.036) * (c.f / d.f_ref) ** e / spacing)
    c.w = c.w * np.sqrt(np.maximum(1 - depth * (1 - ring**2), 4e-4)) * np.exp(depth * over)


@law("mode_shape", (-60, 60))
def _(c, d, gradient):
    c.w = c.w * np.exp(np.clip(gradient * d.x, -2, 2))


@law("force_crosstalk", (-0.3, 0.3))
def _(c, d, s):
    c.read.append(lambda lateral, normal: (lateral + s * d.F, normal))


def unloaded(c, d, share):
    """Restores the true normal force where a share of the friction was taken from the reading."""
    from third_generator import friction
    c.F = np.maximum(c.F + share * d.dir * friction(c), 0.02 * c.F)


@law("force_crosstalk", (-0.5, 0.5))
def _(c, d, s):
    unloaded(c, d, -s)


@law("plate_tilt", (-0.3, 0.3))
def _(c, d, angle):
    unloaded(c, d, np.tan(angle))
    c.F = c.F / np.cos(angle)
    c.read.append(lambda lateral, normal: (lateral * np.cos(angle) + d.F * np.sin(angle), normal))


@law("lateral_offset_drift", (-0.3, 0.3), (-0.4, 0.4), (-0.4, 0.4))
def _(c, d, offset, drift, bend):
    s = d.t / d.duration
    added = offset + drift * (s - 0.5) + bend * ((2 * s - 1) ** 2 - 1 / 3)
    c.read.append(lambda lateral, normal: (lateral + added, normal))


@law("lateral_offset_drift", (-0.4, 0.4), (0.05, 3))
def _(c, d, change, tau):
    c.read.append(lambda lateral, normal: (lateral - change * np.expm1(-d.t / d.duration / tau), normal))


@law("lateral_offset_drift", (-0.3, 0.3), (-0.1, 0.1))
def _(c, d, offset, slope):
    c.read.append(lambda lateral, normal: (lateral + offset + slope * (d.T - 22), normal))


@law("normal_offset", (-0.5, 0.5))
def _(c, d, offset):
    c.F = np.maximum(c.F - offset, 0.02 * c.F)


@law("normal_offset", (-0.5, 0.5))
def _(c, d, offset):
    c.F = np.maximum(c.F - offset * d.t / d.duration, 0.02 * c.F)


@law("speed_error", (-1, 1), (-0.5, 0.5))
def _(c, d, gain, growth):
    c.U = c.U * np.exp(gain * (1 + growth * np.log(c.U / np.exp(np.log(d.U).mean()))))


@law("speed_error", (-0.02, 0.05))
def _(c, d, excess):
    c.U = np.maximum(c.U + excess, 0.05 * c.U)


@law("speed_ripple", (0.01, 0.9), (0.0008, 0.012), (-0.25, 1.25))
def _(c, d, s, pitch, phase):
    c.U = c.U * np.maximum(1 + s * np.sin(2 * np.pi * (d.x / pitch + phase)), 0.05)


# ---- the fit ---------------------------------------------------------------------------------------------------------
def logarithmic(bounds):
    return bounds[0] > 0 and bounds[1] / bounds[0] > 20


def tiled(d, normal, k):
    """The passes k times over, loaded by the normal force that is read."""
    e = SimpleNamespace(**vars(d))
    for name in COLUMNS:
        setattr(e, name, np.tile(getattr(d, name), k))
    e.F = np.tile(normal, k)
    return e


class Fit:
    """One law on the training rows of a table."""

    def __init__(self, d, lateral, normal, rig, sd):
        self.d, self.lateral, self.normal, self.rig, self.sd = d, lateral, normal, rig, sd
        still = d.w == 0
        mu0 = (d.dir * lateral * normal)[still].sum() / (normal[still] ** 2).sum()
        self.nominal, self.widths = np.array([mu0, rig["kn"], rig["kl"]]), np.array([0.3, rig["sd"], rig["sd"]])
        _, base = recalibrated(d, lateral, normal, rig, sd)
        self.base = np.log(base / self.nominal) / self.widths

    def residuals(self, act, points, parameters):
        """Residuals (points x passes) of a law at several points: three nuisances, then sizes and shapes."""
        points = np.atleast_2d(points)
        if len(points) > TOGETHER:
            return np.vstack([self.residuals(act, part, parameters) for part in np.split(points,
                                                            range(TOGETHER, len(points), TOGETHER))])
        n, k = len(self.lateral), len(points)
        each = np.repeat(points, n, 0).T
        theta = [np.exp(x) if logarithmic(b) else x for x, b in zip(each[3:], parameters)]
        nuisances = self.nominal[:, None] * np.exp(self.widths[:, None] * each[:3])
        with np.errstate(all="ignore"):
            force = evaluate(tiled(self.d, self.normal, k), act, theta, *nuisances)[0].reshape(k, n)
        return np.nan_to_num((self.lateral - force) / self.sd, nan=1e3, posinf=1e3, neginf=-1e3)

    def left(self, act, parameters, rng):
        """chi2 that a law leaves of the rows, its best fit with the priors of the nuisances."""
        bounds = np.array([[np.log(b) for b in p] if logarithmic(p) else p for p in parameters], float).reshape(-1, 2)
        low, high = np.concatenate([[-12.0] * 3, bounds[:, 0]]), np.concatenate([[12.0] * 3, bounds[:, 1]])
        count = SCANNED * len(bounds)
        tries = np.column_stack([np.tile(self.base, (count, 1)), rng.uniform(bounds[:, 0], bounds[:, 1],
                                                            (count, len(bounds)))])
        slopes = self.slopes(None, self.base, ())
        found = self.residuals(act, tries, parameters)
        # Nuisances follow linearly in the scan.
        moved = np.linalg.solve(slopes @ slopes.T + np.eye(3), -(found @ slopes.T).T - self.base[:, None]).T
        cost = ((found + moved @ slopes) ** 2).sum(1)
        best = np.inf
        for start in tries[np.argsort(cost)[:STARTS]]:
            out = least_squares(lambda u: np.concatenate([self.residuals(act, u, parameters)[0], u[:3]]), start,
                                jac=lambda u: np.vstack([self.slopes(act, u, parameters).T, np.eye(3, len(u))]),
                                bounds=(low - 1e-9, high + 1e-9), x_scale=np.maximum((high - low) / 24,
                                                            1e-9), max_nfev=EVALUATIONS)
            best = min(best, (self.residuals(act, out.x, parameters) ** 2).sum())
        return best

    def slopes(self, act, u, parameters):
        """Derivatives of the residuals (parameters x passes)."""
        spans = [logarithmic(p) and np.log(p[1] / p[0]) or p[1] - p[0] for p in parameters]
        steps = np.array([*(4e-3 / self.widths), *(2e-3 * x for x in spans)])  # beyond the grain of the cycle's steps
        found = self.residuals(act or nothing, np.vstack([u, u + np.diag(steps)]), parameters)
        return (found[1:] - found[0]) / steps[:, None]


def nothing(c, d):
    """The baseline."""


def inertia_left(fit, rng):
    """The same for ridges with mass: a scan of mass, damping and its power of the plate's speed, twice narrowed, with
    linear nuisances."""
    chi2 = (fit.residuals(nothing, fit.base, ())[0]) ** 2
    keep = np.sort(np.argsort(-chi2)[::2][:INERTIA_PASSES])
    small = Fit.__new__(Fit)
    small.d, small.lateral, small.normal, small.sd = rows(fit.d,
                                                          keep), fit.lateral[keep], fit.normal[keep], fit.sd[keep]
    small.nominal, small.widths, small.base = fit.nominal, fit.widths, fit.base
    slopes, best = small.slopes(None, fit.base, ()), np.inf
    for landing in (1.0, 0.2):
        def act(c, d, mass, zeta, e):
            critical = 2 * np.sqrt(c.kn * mass)
            zeta = np.minimum(zeta * plate_speed(c, d) ** e, 1.0)
            c.mean = lambda c: bounce(c, mass, zeta * critical, 0.0, 60.0, 2 * landing * np.sqrt(60 * c.kn * mass),
                                      0.0, 40, 12)
        centre, width = np.array([np.log(8e-6), np.log(0.45), 0.2]), np.array([1.15, 1.0, 0.7])
        for _ in range(3):
            theta = np.clip(centre + width * rng.uniform(-1, 1, (INERTIA_TRIES, 3)),
                            [*np.log([2.5e-6, 0.1]), -1.0], [*np.log([4e-5, 1.0]), 1.5])
            tries = np.column_stack([np.tile(fit.base, (INERTIA_TRIES, 1)), theta])
            found = small.residuals(act, tries, ((1e-9, 1), (1e-9, 1), (-1, 1.5)))
            moved = np.linalg.solve(slopes @ slopes.T + np.eye(3), -(found @ slopes.T).T - fit.base[:, None]).T
            cost = ((found + moved @ slopes) ** 2).sum(1)
            centre, width = theta[np.argmin(cost)], width * 0.4
            best = min(best, cost.min())
    return best, chi2[keep].sum()


def distance(form, values, d, rig):
    """What the nearest law of the form's name leaves of its noise-free gap, as a share of its root mean square."""
    rng = np.random.default_rng(36)
    train = rows(d, ~d.hidden)
    lateral, normal = (x[~d.hidden] for x in evaluate(d, form.act, values, rig["mu0"], rig["kn_true"], rig["kl_true"]))
    fit = Fit(train, lateral, normal, rig, deviations(rig, lateral, normal))
    if form.name == "ridge_inertia":
        left, whole = inertia_left(fit, rng)
    else:
        whole = (fit.residuals(nothing, fit.base, ())[0] ** 2).sum()
        left = min(fit.left(act, parameters, rng) for act, parameters in LAWS[form.name])
    return float(min(np.sqrt(left / max(whole, 1e-9)), 1.0))
