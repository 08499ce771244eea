"""Campaign folders."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Sequence
from typing import Any, Literal

from . import _native
from ._show import Rows, Shown
from .frfs import Frf, Frfs
from .results import (
    Addition,
    Calibration,
    Comparison,
    CuttingForces,
    Diagnosis,
    Lobes,
    Localisation,
)

__all__ = ["Campaign", "Domain", "Progress"]

Domain = Literal["structure", "cutting"]
#: Called as ``progress(label, done, total)``; an exception that it raises ends the work.
Progress = Callable[[str, int, int], object]


class Campaign(Shown):
    """A campaign folder (with ``campaign.toml`` in it); ``docs/campaign.md`` says what stands there.

    The methods do what the commands of the same name do, each time on the files as they are then, and give the command's
    document as an object. ``domain`` is ``"structure"`` (FRFs) or ``"cutting"`` (force records); where it is left out, the
    FRFs are meant if there are any. ``progress(label, done, total)`` is called while work goes on. Ctrl-C ends a call within
    about a second; what :meth:`add` has recorded by then stays.

    >>> cell = Campaign.load("cell7")
    >>> cell.name, cell.postures
    ('frf-9114', ['p1', 'p2', 'p3', 'p4'])
    """

    def __init__(self, path: str, held: dict[str, Any]) -> None:
        self._path = path
        self._held = held

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Campaign:
        """The campaign in a folder. Raises InputError where ``campaign.toml`` does not say what it should."""
        # From here on wherever the interpreter's working folder is.
        full = os.path.abspath(os.fspath(path))
        return cls(full, json.loads(_native.held(full)))

    @property
    def path(self) -> str:
        """The folder."""
        return self._path

    @property
    def name(self) -> str:
        return str(self._held["name"])

    @property
    def postures(self) -> list[str]:
        """Their ids."""
        return [str(p["id"]) for p in self._held["postures"]]

    @property
    def cuts(self) -> list[str]:
        """Their ids."""
        return [str(c["id"]) for c in self._held["cuts"]]

    def _document(self, command: str, *arguments: str, progress: Progress | None) -> dict[str, Any]:
        text = _native.document([command, self._path, *arguments], progress)
        document: dict[str, Any] = json.loads(text)
        return document

    def _side(self, domain: Domain | None) -> list[str]:
        return ["--domain", domain or ("structure" if self._held["frfs"] else "cutting")]

    def calibrate(
        self,
        *,
        starts: int = 6,
        seed: int = 1,
        from_nominal: bool = False,
        progress: Progress | None = None,
    ) -> Calibration:
        """Tunes the model to the measured FRFs.

        ``starts``: further starting points where the first fit leaves more than noise; ``from_nominal``: start from the
        robot file alone.

        >>> fit = Campaign.load("cell3").calibrate()
        >>> fit["joint-1.stiffness"].unit, fit.covariance.shape == (len(fit.parameters),) * 2
        ('N·m/rad', True)
        """
        more = ["--from-nominal"] if from_nominal else []
        document = self._document("calibrate", f"--starts={starts}", f"--seed={seed}", *more, progress=progress)
        return Calibration.of(document)

    def compare(self, *, domain: Domain | None = None, progress: Progress | None = None) -> Comparison:
        """Model against measurement: where it fails.

        >>> found = Campaign.load("cell3").compare()
        >>> found.nrms < 1.2 * found.noise_floor_nrms
        True
        >>> sorted(found.by["posture"])
        ['p1', 'p2', 'p3', 'p4', 'p5', 'p6']
        """
        return Comparison.of(self._document("compare", *self._side(domain), progress=progress))

    def diagnose(self, *, domain: Domain | None = None, progress: Progress | None = None) -> Diagnosis:
        """Which physical effect the model lacks.

        >>> Campaign.load("cell7").diagnose().label
        'tool-flexibility'
        """
        return Diagnosis.of(self._document("diagnose", *self._side(domain), progress=progress))

    def add(self, effect: str, site: str | None = None, *, progress: Progress | None = None) -> Addition:
        """Adds an effect to the model, fits everything anew and records a revision in the folder.

        ``effect`` may hold the site: ``add("local-resonator@link-3")`` is ``add("local-resonator", "link-3")``.

        >>> grown = Campaign.load("cell7").add("tool-flexibility")
        >>> grown.progress, grown.nrms < 0.1 * grown.nrms_before
        (True, True)
        >>> Campaign.load("cell7").undo()["effects"]
        []
        """
        label = f"{effect}@{site}" if site else effect
        return Addition.of(self._document("add", label, progress=progress))

    def undo(self, *, domain: Domain | None = None) -> dict[str, Any]:
        """Takes the last revision back; the command's document (``undone``, ``revision``, ``effects``)."""
        return self._document("undo", *self._side(domain), progress=None)

    def history(self, *, domain: Domain | None = None) -> list[dict[str, Any]]:
        """The revisions, first to last, as ``lobestone history --json`` has them."""
        return list(self._document("history", *self._side(domain), progress=None)["revisions"])

    def export(
        self,
        folder: str | os.PathLike[str],
        *,
        what: Sequence[str] = (),
        format: Sequence[str] = ("csv",),
        progress: Progress | None = None,
    ) -> list[str]:
        """Writes files for other programs; their paths.

        ``what``: of ``frf``, ``model``, ``residual``, ``modes``, ``lobes``, ``coefficients``, ``records`` (all that the
        campaign holds where left out); ``format``: of ``csv``, ``uff``, ``mat``, ``npz``, ``xlsx``, ``parquet``.

        >>> written = Campaign.load("cell7").export("numbers", what=["frf"], format=["npz"])
        >>> [os.path.basename(path) for path in written]
        ['frf.npz']
        >>> import numpy as np
        >>> np.load(written[0])["p1_receptance_m_per_n"].dtype
        dtype('complex128')
        """
        chosen = [f"--what={','.join(what)}"] if what else []
        document = self._document(
            "export", f"--out={os.fspath(folder)}", f"--format={','.join(format)}", *chosen, progress=progress
        )
        return [str(file["path"]) for file in document["files"]]

    def localise(self, *, progress: Progress | None = None) -> Localisation:
        """Where the missing part sits and what it does, drawn from the data without a library of effects.

        >>> found = Campaign.load("cell7").localise()
        >>> len(found.places) > 5, found.dynamic_stiffness.shape == found.frequency_hz.shape == found.std.shape
        (True, True)
        """
        return Localisation.of(self._document("localise", progress=progress))

    def cfc(
        self,
        *,
        robust: bool = False,
        nonnegative_edges: bool = False,
        progress: Progress | None = None,
    ) -> CuttingForces:
        """Cutting force coefficients of the force records.

        >>> forces = Campaign.load("drill3").cfc()
        >>> ktc = forces.pooled[0].coefficients["Ktc"]
        >>> print(f"{ktc.value:.0f} {ktc.unit}")
        272 N/mm²
        """
        more = ["--robust"] if robust else []
        more += ["--nonnegative-edges"] if nonnegative_edges else []
        return CuttingForces.of(self._document("cfc", *more, progress=progress))

    def lobes(self, *, progress: Progress | None = None) -> Lobes:
        """Stability lobes, as ``[lobes]`` in ``campaign.toml`` asks for them.

        >>> lobes = Campaign.load("cell3").lobes()
        >>> curve = lobes.curves[0]
        >>> bool(curve.depth_limit_mm.min() >= curve.absolute_limit_mm * 0.999)
        True
        """
        return Lobes.of(self._document("lobes", progress=progress))

    def frfs(self, *, progress: Progress | None = None) -> Frfs:
        """Measured FRFs and those of the model as it stands, which is calibrated for that.

        >>> frfs = Campaign.load("cell3").frfs()
        >>> len(frfs), frfs[0].posture
        (54, 'p1')
        >>> frfs.residual.shape == frfs.measured.shape == (54, frfs.frequency_hz.size)
        True
        """
        return Frfs([Frf(*each) for each in _native.frfs(self._path, progress)])

    def _line(self) -> str:
        held = self._held
        robot = f"robot {held['robot']}, " if held["robot"] else ""
        return (
            f"Campaign {self.name!r}: {robot}{len(held['postures'])} postures, {len(held['frfs'])} FRF files, "
            f"{len(held['cuts'])} cuts"
        )

    def _rows(self) -> Rows:
        return [{"posture": p["id"], "joints_deg": p["joints_deg"]} for p in self._held["postures"]]
