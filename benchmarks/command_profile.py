"""Where the time of the whole command goes: `benchmarks.command_profile FILE case.yaml …`.

Runs `python -m lammps_blast.run case.yaml …` in this process while a thread looks, every few
milliseconds, at what the main thread is in, and writes the seconds of every stage to FILE as JSON.
What is imported before the command itself starts is kept to the standard library.
"""

from __future__ import annotations

import json
import runpy
import sys
import threading
import time
from collections import defaultdict
from pathlib import Path
from types import FrameType

PERIOD = 0.005  # s
IMPORTS, REST = "imports", "the command itself"
# The innermost of these functions that the main thread is in names the stage.
STAGES = {
    "load_case": "case and packing",
    "create_particles": "case and packing",
    "write_resolved_case": "deck",
    "write_deck": "deck",
    "run_deck": "LAMMPS",
    "_read_frame": "reading frames",
    "analyze": "analysis",
    "write_results": "analysis",
    "draw_figures": "figures",
}


class Profiler(threading.Thread):
    """Adds up, stage by stage, the time between one look at the main thread and the next."""

    def __init__(self) -> None:
        super().__init__(daemon=True)
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self._over = threading.Event()
        self._main = threading.get_ident()

    def run(self) -> None:
        before = time.perf_counter()
        while not self._over.wait(PERIOD):
            frame, now = sys._current_frames().get(self._main), time.perf_counter()
            self.seconds[stage_of(frame)] += now - before
            before = now

    def stop(self) -> None:
        self._over.set()
        self.join()


def stage_of(frame: FrameType | None) -> str:
    """Return the stage that a stack, given by its innermost frame, is in."""
    while frame is not None:
        code = frame.f_code
        if code.co_filename.startswith("<frozen importlib"):
            return IMPORTS
        if code.co_name in STAGES and "lammps_blast" in code.co_filename:
            return STAGES[code.co_name]
        frame = frame.f_back
    return REST


def main() -> None:
    """Profile the command."""
    result, sys.argv[:] = Path(sys.argv[1]), ["lammps_blast.run", *sys.argv[2:]]
    profiler = Profiler()
    profiler.start()
    try:
        runpy.run_module("lammps_blast.run", run_name="__main__", alter_sys=True)
    finally:
        profiler.stop()
        result.write_text(json.dumps(profiler.seconds))


if __name__ == "__main__":
    main()
