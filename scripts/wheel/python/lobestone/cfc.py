"""Cutting force coefficients of average forces given as arrays."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _native
from ._show import Rows, Shown

__all__ = ["Coefficients", "identify", "identify_drilling"]

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Coefficients(Shown):
    """Coefficients with their errors, in the order of ``names`` and ``units``.

    ``value`` and ``std_error`` are NaN where these cuts cannot tell a coefficient (``inseparable`` then lists which cannot be
    told apart); ``std_error_bootstrap`` is None with fewer than five cuts. ``held``: held at zero by ``nonnegative_edges``.
    ``covariance`` is that of the regression without bounds. ``residual``: measured less fitted, in the shape of the averages.
    ``r2`` by axis.
    """

    names: list[str]
    units: list[str]
    value: Floats
    std_error: Floats
    std_error_bootstrap: Floats | None
    held: list[bool]
    covariance: Floats
    inseparable: list[list[str]]
    residual: Floats
    r2: dict[str, float | None]

    def __getitem__(self, name: str) -> tuple[float, float]:
        """Value and standard error by name: ``found["Ktc"]``."""
        if name not in self.names:
            raise KeyError(f"{name}; there are {', '.join(self.names)}")
        i = self.names.index(name)
        return float(self.value[i]), float(self.std_error[i])

    def _line(self) -> str:
        each = zip(self.names, self.value, self.std_error, self.units)
        return "Coefficients: " + ", ".join(f"{n} {v:.4g} ± {s:.2g} {u}" for n, v, s, u in each)

    def _rows(self) -> Rows:
        return [
            {"coefficient": n, "value": float(v), "std_error": float(s), "unit": u}
            for n, v, s, u in zip(self.names, self.value, self.std_error, self.units)
        ]


def _column(values: npt.ArrayLike, count: int, name: str) -> Floats:
    column = np.asarray(values, dtype=np.float64)
    if column.ndim > 1 or (column.ndim == 1 and column.size != count):
        raise ValueError(f"{name} must be one number, or one for each of the {count} cuts")
    return np.broadcast_to(column, (count,))


def _regression(
    cutting: dict[str, Any],
    averages: npt.ArrayLike,
    std_errors: npt.ArrayLike | None,
    axes: int,
    robust: bool,
    nonnegative_edges: bool,
) -> Coefficients:
    values = np.ascontiguousarray(averages, dtype=np.float64)
    if values.ndim != 2 or values.shape[1] != axes:
        raise ValueError(f"the averages must be (n_cuts, {axes}), not {values.shape}")
    errors = None
    if std_errors is not None:
        errors = np.ascontiguousarray(np.broadcast_to(np.asarray(std_errors, dtype=np.float64), values.shape))
    found = _native.coefficients(cutting, values, errors, robust, nonnegative_edges)
    residual = np.full(values.shape, np.nan)
    for cut, axis, value in found["residual"]:
        residual[cut, axis] = value
    drawn = found["std_error_bootstrap"]
    return Coefficients(
        **{
            **found,
            "residual": residual,
            "r2": dict(found["r2"]),
            "std_error_bootstrap": None if drawn is None else np.array(drawn),
        }
    )


def identify(
    average_forces_n: npt.ArrayLike,
    *,
    feed_per_tooth_mm: npt.ArrayLike,
    axial_depth_mm: npt.ArrayLike,
    teeth: int,
    immersion_deg: tuple[float, float] = (0.0, 180.0),
    std_errors_n: npt.ArrayLike | None = None,
    robust: bool = False,
    nonnegative_edges: bool = False,
) -> Coefficients:
    """Milling coefficients (linear edge law) of average forces: Ktc, Krc, Kac (N/mm²), Kte, Kre, Kae (N/mm).

    ``average_forces_n``: (n_cuts × 3), forces on the tool averaged over a turn in tool axes (x feed, y normal, z axial), NaN where
    an axis was not measured. Feed and depth: one number, or one a cut. ``immersion_deg``: entry and exit, clockwise from +y.
    ``std_errors_n``: standard errors of the averages, where they are known. ``robust``: Huber's regression, which a spoilt cut
    cannot pull. Straight cutting edges; ball ends and inserts through a campaign. (Altintas, Manufacturing Automation,
    2nd ed., eqs 2.41–2.45.)

    A slot with four teeth, 2 mm deep, at four feeds: Fx = −N a/4 Krc c − N a/π Kre, and so on:

    >>> import numpy as np, lobestone
    >>> feed = np.array([0.05, 0.1, 0.15, 0.2])
    >>> n_a = 4 * 2.0
    >>> fx = -n_a / 4 * 300 * feed - n_a / np.pi * 15
    >>> fy = n_a / 4 * 900 * feed + n_a / np.pi * 25
    >>> fz = n_a / np.pi * 120 * feed + n_a / 2 * 3
    >>> found = lobestone.cfc.identify(np.c_[fx, fy, fz], feed_per_tooth_mm=feed, axial_depth_mm=2.0, teeth=4)
    >>> dict(zip(found.names, found.value.round(6).tolist()))
    {'Ktc': 900.0, 'Krc': 300.0, 'Kac': 120.0, 'Kte': 25.0, 'Kre': 15.0, 'Kae': 3.0}
    """
    count = np.shape(average_forces_n)[0] if np.ndim(average_forces_n) else 0
    start, end = np.radians(immersion_deg)
    columns = [
        _column(feed_per_tooth_mm, count, "feed_per_tooth_mm"),
        _column(axial_depth_mm, count, "axial_depth_mm"),
        np.full(count, start),
        np.full(count, end),
    ]
    cutting = {
        "kind": "milling",
        "teeth": teeth,
        "diameter_mm": 1.0,
        "half_point_angle_deg": None,
        "web_thickness_mm": None,
        "cuts": np.column_stack(columns).tolist(),
    }
    return _regression(cutting, average_forces_n, std_errors_n, 3, robust, nonnegative_edges)


def identify_drilling(
    thrust_n_and_torque_nm: npt.ArrayLike,
    *,
    feed_per_rev_mm: npt.ArrayLike,
    diameter_mm: float,
    half_point_angle_deg: float,
    lips: int = 2,
    pilot_diameter_mm: npt.ArrayLike = 0.0,
    web_thickness_mm: float | None = None,
    std_errors: npt.ArrayLike | None = None,
    robust: bool = False,
    nonnegative_edges: bool = False,
) -> Coefficients:
    """Drilling coefficients of average thrust (N) and torque (N·m): Ktc, Kfc (N/mm²), Kte, Kfe (N/mm).

    ``thrust_n_and_torque_nm``: (n_cuts × 2), NaN where one was not measured. A hole without pilot needs ``web_thickness_mm``.

    Thrust = lips (Kfc h + Kfe)(R − r0), with h the chip thickness normal to the lip:

    >>> import numpy as np, lobestone
    >>> feed, half = np.array([0.1, 0.2, 0.3]), np.radians(59)
    >>> h, outer, inner = feed / 2 * np.sin(half), 5.0, 2.0
    >>> thrust = 2 * (400 * h + 30) * (outer - inner)
    >>> torque = 2 * (900 * h + 20) * (outer**2 - inner**2) / (2 * np.sin(half)) / 1000
    >>> found = lobestone.cfc.identify_drilling(
    ...     np.c_[thrust, torque], feed_per_rev_mm=feed, diameter_mm=10, half_point_angle_deg=59, pilot_diameter_mm=4)
    >>> dict(zip(found.names, found.value.round(6).tolist()))
    {'Ktc': 900.0, 'Kte': 20.0, 'Kfc': 400.0, 'Kfe': 30.0}
    """
    count = np.shape(thrust_n_and_torque_nm)[0] if np.ndim(thrust_n_and_torque_nm) else 0
    columns = [
        _column(feed_per_rev_mm, count, "feed_per_rev_mm"),
        _column(pilot_diameter_mm, count, "pilot_diameter_mm"),
    ]
    cutting = {
        "kind": "drilling",
        "teeth": lips,
        "diameter_mm": diameter_mm,
        "half_point_angle_deg": half_point_angle_deg,
        "web_thickness_mm": web_thickness_mm,
        "cuts": np.column_stack(columns).tolist(),
    }
    return _regression(cutting, thrust_n_and_torque_nm, std_errors, 2, robust, nonnegative_edges)
