from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any

import numpy as np
import numpy.typing as npt

VERSION: str

_Progress = Callable[[str, int, int], object]
_Floats = npt.NDArray[np.float64]
_Complexes = npt.NDArray[np.complex128]

def command(arguments: Sequence[str], again: Sequence[str]) -> int: ...
def document(arguments: Sequence[str], progress: _Progress | None = None) -> str: ...
def held(dir: str | PathLike[str]) -> str: ...
def frfs(
    dir: str | PathLike[str], progress: _Progress | None = None
) -> list[tuple[str, str, str, str, _Floats, _Complexes, _Complexes, _Complexes, _Floats]]: ...
def fit(
    frf: _Complexes,
    frequency_hz: _Floats,
    dofs: Sequence[Sequence[str]] | None,
    band_hz: Sequence[float] | None,
    max_order: int | None,
    progress: _Progress | None,
) -> dict[str, Any]: ...
def zero_order(
    spindle_rpm: _Floats,
    modes: Sequence[tuple[int, float, float, float]] | None,
    receptance: tuple[_Floats, _Complexes] | None,
    teeth: int,
    ktc_n_per_mm2: float,
    krc_n_per_mm2: float,
    immersion_rad: tuple[float, float],
    progress: _Progress | None,
) -> tuple[_Floats, _Floats, tuple[float, float] | None, list[tuple[float, float | None, bool]]]: ...
def coefficients(
    cutting: dict[str, Any],
    averages: _Floats,
    std_errors: _Floats | None,
    robust: bool,
    nonnegative_edges: bool,
) -> dict[str, Any]: ...
