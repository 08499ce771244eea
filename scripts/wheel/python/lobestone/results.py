"""What the methods of :class:`lobestone.Campaign` give: the documents of the commands (``docs/json.md``) as objects.

Every result keeps its whole ``document``; what is used most is an attribute. A number that does not exist is None; in an
array it is NaN (or ``inf`` where a depth has no limit, and that is said).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from ._show import Rows, Shown, percent

__all__ = [
    "Addition",
    "Calibration",
    "Candidate",
    "Coefficient",
    "Comparison",
    "CuttingForces",
    "Diagnosis",
    "ForceGroup",
    "LobeCurve",
    "Lobes",
    "Localisation",
    "Parameter",
    "Place",
]

Document = dict[str, Any]
Floats = npt.NDArray[np.float64]
Complexes = npt.NDArray[np.complex128]


def floats(values: list[float | None], none: float = np.nan) -> Floats:
    return np.array([none if v is None else v for v in values], dtype=np.float64)


@dataclass(frozen=True, repr=False)
class Result(Shown):
    """What all results have."""

    document: Document = field(repr=False)

    @property
    def warnings(self) -> list[str]:
        """What should be known before the numbers are believed."""
        return list(self.document.get("warnings") or [])

    @property
    def next_step(self) -> str | None:
        """The next sensible step, in a sentence."""
        step: str | None = self.document.get("next_step")
        return step

    @property
    def setup(self) -> list[Document]:
        """Likely mistakes of files and setup, as ``lobestone diagnose --json`` has them."""
        return list(self.document.get("setup") or [])


@dataclass(frozen=True)
class Parameter:
    """A fitted parameter: ``value`` and ``std_error`` in ``unit``, ``initial`` before the fit."""

    name: str
    value: float
    std_error: float | None
    unit: str
    initial: float | None
    at_bound: bool


def parameters(document: Document) -> list[Parameter]:
    return [
        Parameter(p["name"], p["value"], p["std_error"], p["unit"], p["initial"], p["at_bound"])
        for p in document["parameters"]
    ]


@dataclass(frozen=True, repr=False)
class _Fitted(Result):
    """A result with fitted parameters."""

    parameters: list[Parameter]
    converged: bool
    reduced_chi2: float

    def __getitem__(self, name: str) -> Parameter:
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise KeyError(f"{name}; there are {', '.join(p.name for p in self.parameters)}")

    def _rows(self) -> Rows:
        return [
            {
                "parameter": p.name,
                "value": p.value,
                "std_error": p.std_error,
                "unit": p.unit,
                "initial": p.initial,
                "at_bound": p.at_bound,
            }
            for p in self.parameters
        ]


@dataclass(frozen=True, repr=False)
class Calibration(_Fitted):
    """The model tuned to the measured FRFs.

    ``nrms`` is sqrt(Σ|model − measured|²/Σ|measured|²), ``noise_floor_nrms`` what a perfect model would show;
    ``reduced_chi2`` is 1 where only noise is left. ``correlation`` is that of every two parameters, in their order.
    """

    nrms: float
    nrms_before: float
    noise_floor_nrms: float
    iterations: int
    effects: list[str]
    correlation: Floats

    @property
    def covariance(self) -> Floats:
        """Covariance of the parameters, in their units (n × n); NaN where one is held."""
        std = floats([p.std_error for p in self.parameters])
        return np.asarray(self.correlation * np.outer(std, std))

    @classmethod
    def of(cls, document: Document) -> Calibration:
        return cls(
            document=document,
            parameters=parameters(document),
            converged=document["converged"],
            reduced_chi2=document["reduced_chi2"],
            nrms=document["error"]["nrms"],
            nrms_before=document["error_before"]["nrms"],
            noise_floor_nrms=document["error"]["noise_floor_nrms"],
            iterations=document["iterations"],
            effects=list(document["effects"]),
            correlation=np.array([floats(row) for row in document["correlation"]]),
        )

    def _line(self) -> str:
        ended = "converged" if self.converged else "NOT converged"
        return (
            f"Calibration: {len(self.parameters)} parameters, error {percent(self.nrms_before)} -> {percent(self.nrms)}, "
            f"noise floor {percent(self.noise_floor_nrms)}, {ended}"
        )


@dataclass(frozen=True, repr=False)
class Comparison(Result):
    """Model against measurement, of one side (``domain``) of the campaign.

    ``by`` holds the error (nrms) by posture, direction and point (structure), or by cut, axis, speed, feed and order
    (cutting): ``by["posture"]["p1"]``. ``modes`` pairs measured modes with the model's, ``stands_out`` says in sentences what
    an experienced eye would see.
    """

    domain: str
    nrms: float
    noise_floor_nrms: float
    held_out_nrms: float | None
    by: dict[str, dict[str, float]]
    modes: list[Document]
    stands_out: list[str]
    converged: bool

    @classmethod
    def of(cls, document: Document) -> Comparison:
        kinds = ("posture", "direction", "point", "cut", "axis", "speed", "feed", "order")
        return cls(
            document=document,
            domain=document["domain"],
            nrms=document["error"]["nrms"],
            noise_floor_nrms=document["error"]["noise_floor_nrms"],
            held_out_nrms=document["error"]["held_out_nrms"],
            by={k: dict(document[f"by_{k}"]) for k in kinds if f"by_{k}" in document},
            modes=list(document.get("modes") or []),
            stands_out=list(document.get("stands_out") or []),
            converged=document["converged"],
        )

    def _line(self) -> str:
        return f"Comparison ({self.domain}): error {percent(self.nrms)}, noise floor {percent(self.noise_floor_nrms)}"

    def _rows(self) -> Rows:
        return [{"by": kind, "part": part, "nrms": nrms} for kind, of in self.by.items() for part, nrms in of.items()]


@dataclass(frozen=True)
class Candidate:
    """An effect that was tried: how well the model fits with it."""

    effect: str
    site: str | None
    nrms: float
    held_out_nrms: float | None
    delta_bic: float
    p_value: float | None
    explained_share: float | None
    parameters: Document

    @property
    def label(self) -> str:
        """What :meth:`lobestone.Campaign.add` takes."""
        return f"{self.effect}@{self.site}" if self.site else self.effect


@dataclass(frozen=True, repr=False)
class Diagnosis(Result):
    """Which physical effect the model lacks.

    ``verdict`` is ``"effect"``, ``"none"`` or ``"unknown"``; ``confidence`` is 0 to 1; ``candidates`` are all effects that
    were tried, best first.
    """

    domain: str
    verdict: str
    effect: str | None
    site: str | None
    confidence: float
    candidates: list[Candidate]
    indistinguishable: list[str]
    next_measurement: Document

    @property
    def label(self) -> str | None:
        """What :meth:`lobestone.Campaign.add` takes; None where no effect is named."""
        if self.effect is None:
            return None
        return f"{self.effect}@{self.site}" if self.site else self.effect

    @classmethod
    def of(cls, document: Document) -> Diagnosis:
        keys = ("effect", "site", "nrms", "held_out_nrms", "delta_bic", "p_value", "explained_share", "parameters")
        return cls(
            document=document,
            domain=document["domain"],
            verdict=document["verdict"],
            effect=document["effect"],
            site=document["site"],
            confidence=document["confidence"],
            candidates=[Candidate(**{key: c[key] for key in keys}) for c in document["candidates"]],
            indistinguishable=list(document["indistinguishable"]),
            next_measurement=document["next_measurement"],
        )

    def _line(self) -> str:
        what = {
            "effect": f"missing: {self.label}",
            "none": "nothing is missing",
            "unknown": "something is missing that no effect explains",
        }[self.verdict]
        if self.document.get("too_little_data"):
            what = "no verdict: too little data"
        return f"Diagnosis ({self.domain}): {what} (confidence {100 * self.confidence:.0f} %)"

    def _rows(self) -> Rows:
        return [
            {
                "effect": c.label,
                "nrms": c.nrms,
                "held_out_nrms": c.held_out_nrms,
                "delta_bic": c.delta_bic,
                "p_value": c.p_value,
                "explained_share": c.explained_share,
            }
            for c in self.candidates
        ]


@dataclass(frozen=True, repr=False)
class Addition(_Fitted):
    """A model grown by an effect and fitted anew; it is recorded in the campaign.

    ``progress``: did the error on data left out fall by more than chance (None where none can be left out)?
    ``vanished``: no fit with the effect beats the one without, so its parameters mean nothing.
    """

    effect: str
    site: str | None
    revision: int
    effects: list[str]
    nrms: float
    nrms_before: float
    progress: bool | None
    vanished: bool

    @classmethod
    def of(cls, document: Document) -> Addition:
        return cls(
            document=document,
            parameters=parameters(document),
            converged=document["converged"],
            reduced_chi2=document["reduced_chi2"],
            effect=document["effect"],
            site=document["site"],
            revision=document["revision"],
            effects=list(document["effects"]),
            nrms=document["after"]["nrms"],
            nrms_before=document["before"]["nrms"],
            progress=document["progress"],
            vanished=document["vanished"],
        )

    def _line(self) -> str:
        label = f"{self.effect}@{self.site}" if self.site else self.effect
        worth = {True: "progress", False: "NO progress", None: "not checked on data left out"}[self.progress]
        return (
            f"Addition: revision {self.revision}, + {label}, error {percent(self.nrms_before)} -> {percent(self.nrms)}, "
            f"{worth}"
        )


@dataclass(frozen=True)
class Place:
    """A place where the missing part may sit. ``left`` is Σ|r|²/σ² per complex value with it: 1 is noise. ``add`` is what
    :meth:`lobestone.Campaign.add` takes, None where no simple form fits."""

    place: str
    left: float
    form: str | None
    add: str | None


@dataclass(frozen=True, repr=False)
class Localisation(Result):
    """Where the missing part sits and what it does, drawn from the data alone.

    ``places`` are best first; ``dynamic_stiffness`` (in ``unit``, complex) over ``frequency_hz`` is what sits at the best of
    them, with its standard deviation ``std``; NaN where a line says nothing.
    """

    significant: bool
    places: list[Place]
    unit: str | None
    frequency_hz: Floats
    dynamic_stiffness: Complexes
    std: Floats

    @classmethod
    def of(cls, document: Document) -> Localisation:
        curve = document["curve"] or {"unit": None, "frequency_hz": [], "re": [], "im": [], "std": []}
        return cls(
            document=document,
            significant=document["significant"],
            places=[Place(p["place"], p["left"], p["form"], p["add"]) for p in document["places"]],
            unit=curve["unit"],
            frequency_hz=floats(curve["frequency_hz"]),
            dynamic_stiffness=floats(curve["re"]) + 1j * floats(curve["im"]),
            std=floats(curve["std"]),
        )

    def _line(self) -> str:
        if not self.places:
            return "Localisation: no place"
        best = self.places[0]
        form = f", {best.form}" if best.form else ""
        sure = "" if self.significant else "; no better than chance"
        return f"Localisation: {best.place}{form}, {best.left:.3g} times the noise left{sure}"

    def _rows(self) -> Rows:
        return [{"place": p.place, "left": p.left, "form": p.form, "add": p.add} for p in self.places]


@dataclass(frozen=True)
class Coefficient:
    """A cutting force coefficient in ``unit``. None: the data cannot tell it."""

    name: str
    unit: str
    value: float | None
    std_error: float | None


@dataclass(frozen=True)
class ForceGroup:
    """Coefficients of the cuts of one speed and material, by name: ``group.coefficients["Ktc"]``."""

    process: str
    material: str | None
    cutting_speed_m_per_min: float
    cuts: list[str]
    method: str
    coefficients: dict[str, Coefficient]

    @classmethod
    def of(cls, document: Document) -> ForceGroup:
        found = {}
        for key, value in document.items():
            name, _, unit = key.partition("_n_per_")
            if unit not in ("mm", "mm2"):
                continue
            known = value if isinstance(value, dict) else {"value": None, "std_error": None}
            found[name.capitalize()] = Coefficient(
                name.capitalize(), "N/mm²" if unit == "mm2" else "N/mm", known["value"], known["std_error"]
            )
        return cls(
            process=document["process"],
            material=document["material"],
            cutting_speed_m_per_min=document["cutting_speed_m_per_min"],
            cuts=list(document["cuts"]),
            method=document["method"],
            coefficients=found,
        )


@dataclass(frozen=True, repr=False)
class CuttingForces(Result):
    """Cutting force coefficients of the campaign's force records: ``groups`` by speed and material, ``pooled`` over all
    speeds; the averages of each cut stand in ``document["cuts"]``."""

    groups: list[ForceGroup]
    pooled: list[ForceGroup]

    @classmethod
    def of(cls, document: Document) -> CuttingForces:
        return cls(
            document=document,
            groups=[ForceGroup.of(g) for g in document["groups"]],
            pooled=[ForceGroup.of(g) for g in document["pooled"]],
        )

    def _line(self) -> str:
        if not self.pooled:
            return "CuttingForces: no group of cuts"
        first = self.pooled[0]
        told = ", ".join(
            f"{c.name} {c.value:.4g} ± {c.std_error:.2g} {c.unit}"
            for c in first.coefficients.values()
            if c.value is not None and c.std_error is not None
        )
        return f"CuttingForces ({first.process}, {len(first.cuts)} cuts): {told}"

    def _rows(self) -> Rows:
        return [
            {
                "process": g.process,
                "material": g.material,
                "speed_m_per_min": g.cutting_speed_m_per_min,
                "cuts": len(g.cuts),
                "coefficient": c.name,
                "value": c.value,
                "std_error": c.std_error,
                "unit": c.unit,
            }
            for g in self.groups
            for c in g.coefficients.values()
        ]


@dataclass(frozen=True, repr=False)
class LobeCurve(Shown):
    """The limit over spindle speed: ``depth_limit_mm`` (``inf`` where nothing limits the cut) and ``chatter_hz`` (NaN there).

    ``depth_p05_mm`` and ``depth_p95_mm`` are quantiles over what the model is uncertain by, None where it is not known.
    """

    posture: str | None
    angle_deg: float | None
    spindle_rpm: Floats
    depth_limit_mm: Floats
    chatter_hz: Floats
    absolute_limit_mm: float | None
    depth_p05_mm: Floats | None = None
    depth_p95_mm: Floats | None = None

    @classmethod
    def of(cls, document: Document) -> LobeCurve:
        def band(key: str) -> Floats | None:
            values = document.get(key)
            return None if values is None else floats(values, np.inf)

        return cls(
            posture=document["posture"],
            angle_deg=document["angle_deg"],
            spindle_rpm=floats(document["spindle_rpm"]),
            depth_limit_mm=floats(document["depth_limit_mm"], np.inf),
            chatter_hz=floats(document["chatter_hz"]),
            absolute_limit_mm=document["absolute_limit_mm"],
            depth_p05_mm=band("depth_p05_mm"),
            depth_p95_mm=band("depth_p95_mm"),
        )

    def _line(self) -> str:
        where = f" at {self.posture}" if self.posture else ""
        limit = "no limit" if self.absolute_limit_mm is None else f"always stable below {self.absolute_limit_mm:.3g} mm"
        ends = f"{self.spindle_rpm[0]:g}–{self.spindle_rpm[-1]:g} rpm" if self.spindle_rpm.size else "no speeds"
        return f"LobeCurve{where}: {ends}, {limit}"

    def _rows(self) -> Rows:
        return [
            {"spindle_rpm": float(n), "depth_limit_mm": float(d), "chatter_hz": float(f)}
            for n, d, f in zip(self.spindle_rpm, self.depth_limit_mm, self.chatter_hz)
        ]


@dataclass(frozen=True, repr=False)
class Lobes(Result):
    """Stability lobes: a curve for each posture (or redundancy angle); ``best``: deepest speeds, deepest first."""

    process: str
    method: str
    curves: list[LobeCurve]
    absolute_limit_mm: float | None
    absolute_limit_hz: float | None
    best: list[Document]

    @classmethod
    def of(cls, document: Document) -> Lobes:
        return cls(
            document=document,
            process=document["process"],
            method=document["method"],
            curves=[LobeCurve.of(c) for c in document["curves"]],
            absolute_limit_mm=document["absolute_limit_mm"],
            absolute_limit_hz=document["absolute_limit_hz"],
            best=list(document["best"]),
        )

    def _line(self) -> str:
        limit = "no limit" if self.absolute_limit_mm is None else f"always stable below {self.absolute_limit_mm:.3g} mm"
        return f"Lobes ({self.process}): {len(self.curves)} curves, {limit}"

    def _rows(self) -> Rows:
        return [{"posture": c.posture, "angle_deg": c.angle_deg, **row} for c in self.curves for row in c._rows()]

    def _repr_html_(self) -> str:
        from ._show import table

        return table(self._line(), self.best)
