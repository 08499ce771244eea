"""Modal parameters of FRFs given as arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from . import _native
from ._show import Rows, Shown
from .campaign import Progress

__all__ = ["Modes", "fit"]

Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]


@dataclass(frozen=True, repr=False)
class Modes(Shown):
    """The modes that a set of FRFs shares, ascending in frequency; n_modes is the length of every array's first axis.

    - ``frequency_hz``, ``damping_ratio`` with ``frequency_std_hz``, ``damping_std`` (standard deviations);
    - ``shapes`` (n_modes × n_dofs, complex; the largest component is 1): over ``dofs`` where they were given, else over the
      FRFs; NaN for a degree of freedom that a mode says nothing of;
    - ``modal_constants`` (n_modes × n_frf, 1/kg): φ_response φ_reference of a mass-normalised mode, with ``modal_constants_std``
      (of real and imaginary part each); NaN for an FRF that took no part;
    - ``mpc``: modal phase collinearity, 1 where all move in phase (NaN for a single degree of freedom); ``found_in``: FRFs in
      which the mode stands out of the noise; ``mac``: n_modes × n_modes;
    - ``fitted``: for each FRF frequency (Hz) and fitted receptance (m/N), None for one that took no part;
    - ``rejected``: what resembled a mode and is none: frequency (Hz), damping ratio, why;
    - ``verdict`` (``"good"``, ``"doubtful"``, ``"bad"``) and ``why``, of the FRFs and the fit together.
    """

    frequency_hz: Floats
    frequency_std_hz: Floats
    damping_ratio: Floats
    damping_std: Floats
    mpc: Floats
    found_in: list[int]
    dofs: list[str]
    shapes: Complexes
    modal_constants: Complexes
    modal_constants_std: Floats
    mac: Floats
    fitted: list[tuple[Floats, Complexes] | None]
    rejected: list[tuple[float, float, str]]
    verdict: str
    why: str
    warnings: list[str]

    def __len__(self) -> int:
        return int(self.frequency_hz.size)

    def _line(self) -> str:
        told = ", ".join(f"{f:.4g}" for f in self.frequency_hz[:8])
        more = ", …" if len(self) > 8 else ""
        return f"Modes: {len(self)} at {told}{more} Hz ({self.verdict})" if len(self) else f"Modes: none ({self.why})"

    def _rows(self) -> Rows:
        return [
            {
                "frequency_hz": float(self.frequency_hz[i]),
                "frequency_std_hz": float(self.frequency_std_hz[i]),
                "damping_ratio": float(self.damping_ratio[i]),
                "damping_std": float(self.damping_std[i]),
                "found_in": self.found_in[i],
                "mpc": float(self.mpc[i]),
            }
            for i in range(len(self))
        ]


def fit(
    frf: npt.ArrayLike,
    frequency_hz: npt.ArrayLike,
    *,
    dofs: Sequence[tuple[str, str]] | None = None,
    band_hz: tuple[float, float] | None = None,
    max_order: int | None = None,
    progress: Progress | None = None,
) -> Modes:
    """Modes that all FRFs of a structure in one state share, as ``lobestone modal`` finds them in files.

    ``frf``: receptances, m/N, time factor e^{+iωt}, (n_frf × n_lines) or (n_lines); ``frequency_hz``: ascending, Hz.
    ``dofs``: response and reference of each FRF by any names that are equal where the degree of freedom is; without them
    shapes run over the FRFs. ``band_hz``: from, to. ``max_order``: highest order of the stabilisation diagram.

    A spring, mass and damper of 20 Hz and 2 %, seen through two FRFs:

    >>> import numpy as np, lobestone
    >>> f = np.arange(2.0, 60.0, 0.1)
    >>> one = 0.1 / ((2 * np.pi) ** 2 * (20.0**2 - f**2 + 2j * 0.02 * 20.0 * f))
    >>> noise = np.random.default_rng(1).normal(0, 1e-7, (2, f.size, 2)) @ [1, 1j]
    >>> modes = lobestone.modal.fit(np.array([one, -0.5 * one]) + noise, f)
    >>> print(modes.frequency_hz.round(2), modes.damping_ratio.round(3), modes.shapes.real.round(1))
    [20.] [0.02] [[ 1.  -0.5]]
    """
    values = np.atleast_2d(np.ascontiguousarray(frf, dtype=np.complex128))
    lines = np.ascontiguousarray(frequency_hz, dtype=np.float64)
    if values.ndim != 2 or lines.ndim != 1:
        raise ValueError(f"frf must be (n_frf, n_lines) and frequency_hz (n_lines), not {values.shape} and {lines.shape}")
    names = None if dofs is None else [[str(a), str(b)] for a, b in dofs]
    found = _native.fit(values, lines, names, band_hz, max_order, progress)
    found["modal_constants_std"] = found["modal_constants_std"].real
    return Modes(**found)
