"""What the tests that kill workers share (scripts/batch/test_resume.py, scripts/sweep/test_resume.py); Linux."""

import os
import signal
import sys
import time
from pathlib import Path


def need(holds, what):
    if not holds:
        sys.exit(f"FAILED: {what}")


def processes(of_session=None):
    """Ids and command lines of all processes, or of those of a session, from /proc."""
    found = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            # Behind the name in brackets: state, parent, group, session.
            fields = stat.read_text().rpartition(")")[2].split()
            if of_session in (None, int(fields[3])) and fields[0] != "Z":
                found[int(stat.parent.name)] = (stat.parent / "cmdline").read_bytes().split(b"\0")
        except OSError:
            continue
    return found


def kill(process):
    """It may have ended by itself since it was seen."""
    try:
        os.kill(process, signal.SIGKILL)
    except ProcessLookupError:
        pass


def kill_all_of(run):
    """Kills a process that leads a session with all that is in it, as a power cut would."""
    deadline = time.monotonic() + 10
    # Again until none is left: one may just have been starting another.
    while left := processes(run.pid):
        for process in left:
            kill(process)
        run.poll()
        need(time.monotonic() < deadline, "jobs outlived the kill")
        time.sleep(0.02)
    run.wait()
