"""Lobestone: fits physical models of machining robots to measurements, and says which physics the model lacks.

A campaign folder is a :class:`Campaign`; its methods do what the commands of the same name do. Arrays go straight to
:func:`lobestone.modal.fit`, :func:`lobestone.lobes.zero_order` and :func:`lobestone.cfc.identify`.

>>> import lobestone
>>> cell = lobestone.Campaign.load("cell7")
>>> cell
Campaign 'frf-9114': robot irb6640, 4 postures, 4 FRF files, 0 cuts

SI units inside; where another unit is usual it stands in the name (``frequency_hz``, ``depth_mm``). Long calls let other
Python threads work, end within about a second at Ctrl-C, and tell how far they are: ``progress=print``.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from ._native import VERSION as __version__

if TYPE_CHECKING:
    from . import cfc as cfc
    from . import lobes as lobes
    from . import modal as modal
    from .campaign import Campaign
    from .errors import ComputationError, FileError, InputError, LobestoneError

__all__ = [
    "Campaign",
    "ComputationError",
    "FileError",
    "InputError",
    "LobestoneError",
    "__version__",
    "cfc",
    "lobes",
    "modal",
]

_HOME = {
    "Campaign": "campaign",
    "ComputationError": "errors",
    "FileError": "errors",
    "InputError": "errors",
    "LobestoneError": "errors",
}


def __getattr__(name: str) -> Any:
    # The command comes from this package too, and should not wait for numpy.
    if name in _HOME:
        return getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    if name in ("cfc", "lobes", "modal"):
        return importlib.import_module(f".{name}", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
