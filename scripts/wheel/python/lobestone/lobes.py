"""Stability lobes of numbers and arrays."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from . import _native
from .campaign import Progress
from .results import LobeCurve

__all__ = ["Mode", "Tip", "ZeroOrder", "zero_order"]


class Mode(NamedTuple):
    """A mode of the tool point along ``axis`` (``"x"`` feed, ``"y"`` normal): H = (1/k) ω_n²/(ω_n² − ω² + 2iζω_nω)."""

    axis: str
    frequency_hz: float
    damping_ratio: float
    stiffness_n_per_m: float


class Tip(NamedTuple):
    """A deepest speed; ``depth_mm`` is None where nothing limits the cut. ``at_range_end``: it may be deeper beyond."""

    spindle_rpm: float
    depth_mm: float | None
    at_range_end: bool


@dataclass(frozen=True, repr=False)
class ZeroOrder(LobeCurve):
    """A :class:`~lobestone.results.LobeCurve` with ``absolute_limit_hz`` (chatter at the depth that is stable at every
    speed) and ``best`` (the deepest speeds, deepest first)."""

    absolute_limit_hz: float | None = None
    best: tuple[Tip, ...] = ()


def zero_order(
    spindle_rpm: npt.ArrayLike,
    *,
    teeth: int,
    ktc_n_per_mm2: float,
    krc_n_per_mm2: float,
    immersion_deg: tuple[float, float] = (0.0, 180.0),
    modes: Sequence[Mode | tuple[str, float, float, float]] | None = None,
    receptance: npt.ArrayLike | None = None,
    frequency_hz: npt.ArrayLike | None = None,
    progress: Progress | None = None,
) -> ZeroOrder:
    """Zero-order stability lobes in milling (Altintas & Budak 1995): the axial depth at which chatter starts.

    ``spindle_rpm``: ascending. ``immersion_deg``: entry and exit, clockwise from the normal direction +y (0 to 180: a slot).
    The tool point by its ``modes``, or by its measured ``receptance`` (n_lines × 2 × 2, m/N: line, response axis, force axis; x is
    the feed, y the normal) on ``frequency_hz``.

    >>> import numpy as np, lobestone
    >>> curve = lobestone.lobes.zero_order(
    ...     np.linspace(2000, 12000, 501), teeth=4, ktc_n_per_mm2=700, krc_n_per_mm2=210,
    ...     modes=[("x", 600, 0.03, 2e7), ("y", 660, 0.03, 2e7)])
    >>> bool(curve.depth_limit_mm.min() > 0.99 * curve.absolute_limit_mm), curve.best[0].depth_mm > 2 * curve.absolute_limit_mm
    (True, True)
    """
    speeds = np.ascontiguousarray(spindle_rpm, dtype=np.float64)
    if speeds.ndim != 1:
        raise ValueError("spindle_rpm must be one row of speeds")
    if (modes is None) == (receptance is None):
        raise ValueError("give modes, or receptance with frequency_hz")
    sampled = None
    if receptance is not None:
        if frequency_hz is None:
            raise ValueError("receptance needs frequency_hz")
        sampled = (
            np.ascontiguousarray(frequency_hz, dtype=np.float64),
            np.ascontiguousarray(receptance, dtype=np.complex128),
        )
        if sampled[1].shape != (sampled[0].size, 2, 2):
            raise ValueError(f"receptance must be (n_lines, 2, 2) on n_lines frequencies, not {sampled[1].shape}")
    start, end = (float(np.radians(angle)) for angle in immersion_deg)
    depth, chatter, absolute, tips = _native.zero_order(
        speeds,
        None if modes is None else [_mode(*mode) for mode in modes],
        sampled,
        teeth,
        ktc_n_per_mm2,
        krc_n_per_mm2,
        (start, end),
        progress,
    )
    return ZeroOrder(
        posture=None,
        angle_deg=None,
        spindle_rpm=speeds,
        depth_limit_mm=depth,
        chatter_hz=chatter,
        absolute_limit_mm=absolute and absolute[0],
        absolute_limit_hz=absolute and absolute[1],
        best=tuple(Tip(*tip) for tip in tips),
    )


def _mode(axis: str, frequency_hz: float, damping_ratio: float, stiffness: float) -> tuple[int, float, float, float]:
    if axis not in ("x", "y"):
        raise ValueError(f"the axis of a mode is 'x' or 'y', not {axis!r}")
    return ("xy".index(axis), frequency_hz, damping_ratio, stiffness)
