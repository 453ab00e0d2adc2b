"""What a checker of types must accept, and what it must not: run by mypy --strict."""

from concurrent.futures import ThreadPoolExecutor

import muprime
import numpy as np
from numpy.typing import NDArray

law: muprime.Law = muprime.spring_slider(np.array([1e-6, 2e-6]), finger=muprime.Finger(poisson_ratio=0.4))
mu: NDArray[np.float64] = law.mu_relative
verdict: muprime.Verdict = muprime.diagnose("points.csv")
shrinkage: float | None = verdict.shrinkage
name: str = verdict.hypotheses[0].effects[0]
run: muprime.Run = muprime.load("runs/x")
muprime.run("first-sweep")  # type: ignore[call-arg]
muprime.psi(frequency=1.0)  # type: ignore[call-arg]
plan: muprime.Plan = muprime.Plan.make("p", {"amplitude_pp_m": [1e-6, 2e-6]}, replicates=2)
passes: dict[str, NDArray[np.float64]] = plan.passes("virtual-ideal")
again: muprime.Run = muprime.run(plan, out="runs/y")
certificate: muprime.Certificate = muprime.calibrate("finger", "phases.csv", operator="x", serial="y", modulus_only=True)
modulus: float = muprime.fit_finger("phases.csv").young_modulus_pa.value
muprime.calibrate("finger", operator="x")  # type: ignore[call-arg]
study: muprime.Study = muprime.study("ridge.jsonl", "study", ThreadPoolExecutor(), workers=2)
digest: str = study.gather().sha256
muprime.study("ridge.jsonl", "study")  # type: ignore[call-arg]
