"""What a checker of types must accept, and what it must not: run by mypy --strict."""

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
