"""The command line: `lobestone …` and `python -m lobestone …`."""

from __future__ import annotations

import signal
import sys

from ._native import command

# Starts this program once more, whatever the console script is called: what `serve` does its work with.
_AGAIN = [sys.executable, "-m", "lobestone"]


def main() -> int:
    """Runs the command line; the exit status."""
    # Ctrl-C ends the program as it ends any other, not at the next Python statement (unless whoever started it wants
    # it ignored).
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    return command(sys.argv[1:], _AGAIN)
