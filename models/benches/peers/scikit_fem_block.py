"""The layered block of the kernel's benchmark with scikit-fem: element updates per second of one core.

CPU seconds of this thread, so that a busy machine does not count. Matrix assembled once, then explicit central differences with a lumped mass: the fastest way of that library.
    pip install scikit-fem scipy numpy
    python scikit_fem_block.py
Compare with `cargo bench -p muprime-models --bench ridge_kernel` run beside it on the same machine.
"""
import os
import time

os.environ.setdefault("OMP_NUM_THREADS", "1")
import numpy as np
from skfem import Basis, BilinearForm, ElementQuad1, ElementVector, MeshQuad
from skfem.helpers import ddot, sym_grad, trace

NX, NY, WIDTH, HEIGHT = 25, 60, 500e-6, 2700e-6
NU, RHO, STEPS, PRESSURE = 0.33, 750.0, 20000, 7e3


def young(y):
    return np.where(y < 300e-6, 28.3e6, np.where(y < 900e-6, 1.5e6, 0.02e6))


mesh = MeshQuad.init_tensor(np.linspace(0, WIDTH, NX + 1), np.linspace(0, HEIGHT, NY + 1))
basis = Basis(mesh, ElementVector(ElementQuad1()))


@BilinearForm
def stiffness(u, v, w):
    e = young(w.x[1])
    lame, shear = e * NU / ((1 + NU) * (1 - 2 * NU)), e / (2 * (1 + NU))
    a, b = sym_grad(u), sym_grad(v)
    return lame * trace(a) * trace(b) + 2 * shear * ddot(a, b)


@BilinearForm
def mass(u, v, w):
    return RHO * (u[0] * v[0] + u[1] * v[1])


k = stiffness.assemble(basis).tocsr()
m = np.asarray(mass.assemble(basis).sum(axis=1)).ravel()
top = basis.get_dofs(lambda x: np.isclose(x[1], HEIGHT)).flatten()
free = 1.0 / m
free[top] = 0.0
load = np.zeros_like(m)
bottom = basis.get_dofs(lambda x: np.isclose(x[1], 0.0)).all("u^2")
load[bottom] = PRESSURE * WIDTH / len(bottom)
speed = np.sqrt(28.3e6 * (1 - NU) / ((1 + NU) * (1 - 2 * NU)) / RHO)
dt = 0.5 * min(WIDTH / NX, HEIGHT / NY) / speed
u, v = np.zeros_like(m), np.zeros_like(m)
start = time.process_time()
for _ in range(STEPS):
    v += dt * free * (load - k @ u)
    u += dt * v
seconds = time.process_time() - start
assert np.isfinite(u).all()
print(f"scikit-fem, matrix once: {NX * NY * STEPS / seconds / 1e6:.1f} million element updates/s, "
      f"surface moved {u[bottom].mean() * 1e6:.2f} um in {STEPS * dt * 1e6:.0f} us")
