"""How results show themselves: a line or two in a terminal, a small table in a notebook, a frame for pandas."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas

# Rows of a table in a notebook.
_SHOWN = 30

Rows = list[dict[str, Any]]


def percent(value: float | None) -> str:
    return "–" if value is None else f"{100 * value:.3g} %"


def frame(rows: Sequence[dict[str, Any]]) -> pandas.DataFrame:
    """The rows as a pandas frame; pandas is asked for here only."""
    try:
        import pandas
    except ImportError as error:
        raise ImportError("to_frame() needs pandas: pip install pandas") from error
    return pandas.DataFrame(list(rows))


def _cell(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.4g}"
    return escape(str(value))


def table(title: str, rows: Rows) -> str:
    """An HTML table with a title."""
    if not rows:
        return f"<p>{escape(title)}</p>"
    head = "".join(f"<th>{escape(key)}</th>" for key in rows[0])
    body = "".join(
        "<tr>" + "".join(f"<td>{_cell(value)}</td>" for value in row.values()) + "</tr>" for row in rows[:_SHOWN]
    )
    more = f"<p>… and {len(rows) - _SHOWN} more</p>" if len(rows) > _SHOWN else ""
    return f"<p>{escape(title)}</p><table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>{more}"


class Shown:
    """Something with a one-line summary and rows."""

    def _line(self) -> str:
        raise NotImplementedError

    def _rows(self) -> Rows:
        raise NotImplementedError

    def __repr__(self) -> str:
        return self._line()

    def _repr_html_(self) -> str:
        return table(self._line(), self._rows())

    def to_frame(self) -> pandas.DataFrame:
        """The rows as a pandas frame (pandas has to be installed)."""
        return frame(self._rows())
