"""muprime in Python: runs, friction laws and the diagnosis, from the same code as the ``muprime`` command.

All quantities are SI; a name ends with its unit. ``amplitude_pp_m`` is peak-to-peak. A refusal is a :class:`MuprimeError`, which
says what is wrong, where, and what to do.

>>> import muprime
>>> law = muprime.spring_slider(amplitude_pp_m=[1e-6, 2e-6, 4e-6])
>>> [round(float(mu), 3) for mu in law.mu_relative]
[0.461, 0.296, 0.191]
"""

from ._muprime import MuprimeError, __version__
from .calibration import Certificate, CertifiedParameter, Estimate, Skin, calibrate, fit_finger, load_certificate
from .fidelity import Fidelity, render
from .laws import Finger, Law, models, psi, ridge, spring_slider, surrogate
from .own_law import LawTable, tabulate
from .plans import Plan
from .runs import Run, load, run
from .studies import Gathered, Study, study
from .verdict import Hypothesis, Parameter, Region, Verdict, diagnose

__all__ = [
    "Certificate",
    "CertifiedParameter",
    "Estimate",
    "Fidelity",
    "Finger",
    "Gathered",
    "Hypothesis",
    "Law",
    "LawTable",
    "MuprimeError",
    "Parameter",
    "Plan",
    "Region",
    "Run",
    "Skin",
    "Study",
    "Verdict",
    "__version__",
    "calibrate",
    "diagnose",
    "fit_finger",
    "load",
    "load_certificate",
    "models",
    "psi",
    "render",
    "ridge",
    "run",
    "spring_slider",
    "study",
    "surrogate",
    "tabulate",
]
