"""The door to the Rust crates: see the modules beside it for what people call."""

from collections.abc import Sequence
from os import PathLike

from numpy import float64, uint8
from numpy.typing import NDArray

__version__: str

class MuprimeError(ValueError): ...

def models_json() -> str: ...
def evaluate(
    name: str,
    columns: Sequence[NDArray[float64]],
    finger: tuple[float, float, float, float, float, float | None],
    reading: str | None,
    out: Sequence[NDArray[float64]],
    inside: NDArray[uint8],
) -> None: ...
def psi_curve(
    columns: Sequence[NDArray[float64]], poisson_ratio: float, psi_star: float, out: NDArray[float64]
) -> None: ...
def fit_psi(
    columns: Sequence[NDArray[float64]], mu_relative: NDArray[float64], curves: list[int], poisson_ratio: float
) -> tuple[float, float, float]: ...
def ridge(columns: Sequence[NDArray[float64]], elements: int) -> str: ...
def calibrate(words: list[str]) -> tuple[str, str]: ...
def certificate(name: str, text: str) -> str: ...
def fit_finger(
    phases: bytes,
    frequency_hz: float | None,
    normal_force_n: float | None,
    modulus_range_pa: tuple[float, float],
    elements: int,
    modulus_only: bool,
) -> str: ...
def plan_load(name: str) -> tuple[str, str, str]: ...
def plan_parse(name: str, text: str) -> tuple[str, str, str]: ...
def plan_made(document: str) -> tuple[str, str, str]: ...
def plan_passes(name: str, text: str, setup: str, seed: int | None) -> str: ...
def diagnose(
    tables: list[tuple[str, bytes, str | None]],
    rig_name: str,
    rig: str,
    pairs: bool,
    without: list[str],
    predict: bytes | None,
    damage: list[str],
    model: tuple[str, str | None] | None,
    effects: list[str],
) -> tuple[str, str, str, str | None, str | None]: ...
def law_grid(name: str, table: bytes, variables: list[str]) -> list[tuple[str, list[float]]]: ...
def law_conditions(
    nodes: list[tuple[str, list[float]]], checks: int
) -> tuple[list[str], list[list[float]]]: ...
def law_table(
    nodes: list[tuple[str, list[float]]], checks: int, answers: list[tuple[float, float]], origin: str, tolerance: float
) -> tuple[str, str]: ...
def load(folder: str | PathLike[str]) -> tuple[bytes, str]: ...
def cycles(folder: str | PathLike[str], points: list[int]) -> bytes: ...
def fidelity(folder: str | PathLike[str]) -> str: ...
def run(
    plan: str,
    text: str,
    setup: str,
    out: str | PathLike[str],
    seed: int | None,
    defects: str | PathLike[str] | None,
    model: str | PathLike[str] | None,
    operator: str | None,
    sample: str | None,
    licence: str | None,
) -> str: ...
