"""FRFs of a campaign, measured and modelled."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ._show import Rows, Shown, percent
from .results import Complexes, Floats

__all__ = ["Frf", "Frfs"]


@dataclass(frozen=True, repr=False)
class Frf(Shown):
    """One measured FRF and the calibrated model's: receptances in m/N (time factor e^{+iωt}) on ``frequency_hz``.

    ``robot_file`` is the model before calibration; ``noise_std`` the standard deviation of the measured complex value.
    """

    name: str
    posture: str
    response: str
    reference: str
    frequency_hz: Floats
    measured: Complexes
    robot_file: Complexes
    modelled: Complexes
    noise_std: Floats

    @property
    def residual(self) -> Complexes:
        """Modelled less measured, m/N."""
        return np.asarray(self.modelled - self.measured)

    @property
    def nrms(self) -> float:
        """sqrt(Σ|modelled − measured|²/Σ|measured|²)."""
        return float(np.linalg.norm(self.residual) / np.linalg.norm(self.measured))

    def _line(self) -> str:
        return f"Frf {self.response}/{self.reference} at {self.posture}: {self.frequency_hz.size} lines, error {percent(self.nrms)}"

    def _rows(self) -> Rows:
        return [
            {"frequency_hz": float(f), "measured": complex(h), "modelled": complex(m)}
            for f, h, m in zip(self.frequency_hz, self.measured, self.modelled)
        ]


class Frfs(Shown):
    """All FRFs of a campaign: a sequence of :class:`Frf`, and arrays (n_frf × n_lines) where they share their lines."""

    def __init__(self, frfs: list[Frf]) -> None:
        self._frfs = list(frfs)

    def __len__(self) -> int:
        return len(self._frfs)

    def __getitem__(self, index: int) -> Frf:
        return self._frfs[index]

    def at(self, posture: str) -> Frfs:
        """Those of one posture."""
        return Frfs([f for f in self._frfs if f.posture == posture])

    @property
    def names(self) -> list[str]:
        return [f.name for f in self._frfs]

    @property
    def dofs(self) -> list[tuple[str, str]]:
        """Response and reference of each, such as ``("1X", "1Z")``."""
        return [(f.response, f.reference) for f in self._frfs]

    @property
    def frequency_hz(self) -> Floats:
        """The lines that all FRFs share (n_lines)."""
        if not self._frfs:
            return np.empty(0)
        first = self._frfs[0].frequency_hz
        if not all(np.array_equal(f.frequency_hz, first) for f in self._frfs):
            raise ValueError("these FRFs have lines of their own: take those of one posture, .at('p1'), or one by one")
        return first

    def _stacked(self, what: str) -> Complexes:
        lines = self.frequency_hz.size
        return np.array([getattr(f, what) for f in self._frfs], dtype=np.complex128).reshape(len(self), lines)

    @property
    def measured(self) -> Complexes:
        """Measured receptances, m/N."""
        return self._stacked("measured")

    @property
    def modelled(self) -> Complexes:
        """Those of the calibrated model, m/N."""
        return self._stacked("modelled")

    @property
    def residual(self) -> Complexes:
        """Modelled less measured, m/N."""
        return np.asarray(self.modelled - self.measured)

    def _line(self) -> str:
        postures = len({f.posture for f in self._frfs})
        return f"Frfs: {len(self)} at {postures} postures"

    def _rows(self) -> Rows:
        return [
            {
                "name": f.name,
                "posture": f.posture,
                "response": f.response,
                "reference": f.reference,
                "lines": int(f.frequency_hz.size),
                "nrms": f.nrms,
            }
            for f in self._frfs
        ]
