"""What goes wrong, as exceptions; each message says what, where, and what to do about it."""

from __future__ import annotations

__all__ = ["ComputationError", "FileError", "InputError", "LobestoneError"]


class LobestoneError(Exception):
    """Lobestone could not do what it was asked for."""


class InputError(LobestoneError, ValueError):
    """A file or an argument does not say what it should.

    ``file``, ``line`` (from 1), ``key`` (dotted, such as ``cut[3].feed_per_tooth_mm``) and ``remedy`` are None where there
    is none; ``problem`` is the sentence alone.

    >>> from lobestone import Campaign, InputError
    >>> try:
    ...     Campaign.load("cell7/frf")
    ... except InputError as error:
    ...     print(error.problem)
    there is no such file
    """

    def __init__(
        self,
        message: str,
        file: str | None = None,
        line: int | None = None,
        key: str | None = None,
        problem: str = "",
        remedy: str | None = None,
    ) -> None:
        super().__init__(message)
        self.file, self.line, self.key = file, line, key
        self.problem, self.remedy = problem or message, remedy


class FileError(LobestoneError, OSError):
    """A file cannot be read or written; ``filename`` says which."""

    def __init__(self, message: str, filename: str | None = None) -> None:
        super().__init__(message)
        self.filename = filename

    def __str__(self) -> str:
        return str(self.args[0])


class ComputationError(LobestoneError):
    """What was given is well formed, but its numbers allow no answer."""
