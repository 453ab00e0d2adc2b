"""The door to the Rust crates: see the modules beside it for what people call."""

from collections.abc import Sequence
from os import PathLike

from numpy import float64
from numpy.typing import NDArray

__version__: str

class MuprimeError(ValueError): ...

def evaluate(
    name: str,
    columns: Sequence[NDArray[float64]],
    finger: tuple[float, float, float, float, float, float | None],
    reading: str | None,
    out: Sequence[NDArray[float64]],
) -> None: ...
def ridge(
    amplitude_pp_m: float,
    frequency_hz: float,
    speed_m_s: float,
    normal_force_n: float,
    mu0: float,
    young_modulus_pa: float,
    poisson_ratio: float,
    elements: int,
) -> str: ...
def diagnose(
    name: str,
    table: bytes,
    rig_name: str,
    rig: str,
    pairs: bool,
    without: list[str],
    predict: bytes | None,
    damage: list[str],
) -> tuple[str, str, str, str | None]: ...
def load(folder: str | PathLike[str]) -> tuple[bytes, str]: ...
def run(
    plan: str,
    setup: str,
    out: str | PathLike[str],
    seed: int | None,
    defects: str | PathLike[str] | None,
    model: str | PathLike[str] | None,
    operator: str | None,
    sample: str | None,
    licence: str | None,
) -> str: ...
