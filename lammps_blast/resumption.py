"""Going on with a run that was interrupted, or making a finished one longer."""

from __future__ import annotations

import contextlib
import filecmp
import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lammps_blast.case import Case, CaseError, ParticlesFromFile, dump_case, load_case, parse_case
from lammps_blast.deck import CASE, DECK, LOG, PARTICLE_TABLE, RESTARTS
from lammps_blast.input_files import mapped
from lammps_blast.pair_commands import number
from lammps_blast.restart_notes import RestartNotes, look_at_restarts

# What may change when a run goes on: how it is called, how long it lasts, how often it is saved.
FREE_KEYS = {"name", "title", "time.duration", "output.restart_interval"}


class ResumptionError(RuntimeError):
    """A run cannot be gone on with; `str()` says why and what to do."""


@dataclass(frozen=True)
class Resumption:
    """A run to go on with.

    Attributes
    ----------
    case
        The case of the run folder, with its new duration.
    state
        Where it goes on; None from the beginning.
    unusable
        Why other restart files, if there are any, cannot be gone on from.
    has_gone_further
        Whether output files hold more than belongs to that state.
    """

    case: Case
    state: RestartNotes | None = None
    unusable: tuple[str, ...] = ()
    has_gone_further: bool = False

    @property
    def steps_done(self) -> int:
        """Steps of LAMMPS that need not be done again."""
        return self.state.step if self.state else 0

    @property
    def is_finished(self) -> bool:
        """Whether there is nothing left to do for LAMMPS."""
        return self.steps_done == self.case.timesteps and not self.has_gone_further


def resumption(case_file: Path, folder: Path) -> Resumption:
    """Compare a case with the run of a folder, and find where that goes on.

    Raises
    ------
    ResumptionError
        If there is no run in the folder, or it is one of another case.
    CaseError
        If the case is invalid, or its duration does not fit the steps of the run.
    """
    if not (folder / CASE).is_file():
        raise ResumptionError(
            f"{folder / CASE} is gone, without which a run cannot go on: put the case back, or"
            " give another folder (--output)"
        )
    try:
        kept = load_case(folder / CASE)
    except CaseError as error:
        raise ResumptionError(f"the case of the run in {folder} is damaged: {error}") from None
    asked = load_case(case_file)
    as_it_was = load_case(case_file, of_run=kept)
    if changes := _changes(kept, as_it_was) + _changed_particles(kept, asked, folder):
        lines = "\n".join(f"  {change}" for change in changes)
        raise ResumptionError(
            f"{folder} holds a run of another case than {case_file}:\n{lines}\n"
            "undo these changes, or run the case in another folder (--output)"
        )
    case = _with_duration(kept, asked, as_it_was)
    state, unusable = look_at_restarts(folder, RESTARTS)
    if state is None:
        _require_nothing_to_lose(folder, unusable)
    if state and not (folder / DECK).is_file():
        raise ResumptionError(f"{folder / DECK} is gone: a run cannot go on without its deck")
    if state and state.step > case.timesteps:
        raise ResumptionError(
            f"the run in {folder} has come to {state.time:g} s already:"
            f" time.duration must be at least that, got {case.time.duration:g}"
        )
    has_gone_further = state is not None and state.is_outgrown(folder)
    return Resumption(case, state, tuple(unusable), has_gone_further)


def _require_nothing_to_lose(folder: Path, unusable: list[str]) -> None:
    """Refuse to begin anew where a run has come to a restart file, which cannot be used."""
    reasons = list(unusable)
    with contextlib.suppress(OSError), mapped(folder / LOG) as log:
        if not reasons and re.search(rb"(?m)^Restart file .* written at step ", log):
            reasons.append(f"{folder / RESTARTS[0]} and {folder / RESTARTS[1]} are gone")
    if reasons:
        raise ResumptionError(
            f"the run in {folder} cannot be gone on with:\n  "
            + "\n  ".join(reasons)
            + "\nits files are as they were, to be copied or analysed; --force in place of --resume"
            " removes them, and begins anew"
        )


def prepare_resumption(run: Resumption, folder: Path) -> None:
    """Write the duration of a run that goes on into its case and its deck.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    assert run.case.output.restart_interval is not None  # resolved when the case was checked
    settings = {
        "duration": run.case.time.duration,
        "restart_interval": run.case.output.restart_interval,
    }
    deck = (folder / DECK).read_text(encoding="utf-8", errors="surrogateescape")
    for name, value in settings.items():
        line = f"variable {name} index {number(value)}"
        deck = re.sub(rf"^variable {name} index .*$", line, deck, count=1, flags=re.M)
    _replace(folder / DECK, deck)
    _replace(folder / CASE, dump_case(run.case))


def _replace(file: Path, text: str) -> None:
    """Write a file so that it holds the old text or the new one, whatever happens."""
    unfinished = file.with_name(f"{file.name}.unfinished")
    with unfinished.open("w", encoding="utf-8", errors="surrogateescape") as stream:
        stream.write(text)
        stream.flush()
        os.fsync(stream.fileno())
    unfinished.replace(file)


def _changes(kept: Case, asked: Case) -> list[str]:
    before, after = _flat(_content(kept)), _flat(_content(asked))
    return [
        f"{key}: {before.get(key, 'absent')} in the run, {after.get(key, 'absent')} in the case"
        for key in sorted(before.keys() | after.keys())
        if before.get(key) != after.get(key) and key not in FREE_KEYS
    ]


def _content(case: Case) -> Mapping[str, Any]:
    content = case.model_dump(mode="json")
    if isinstance(case.particles, ParticlesFromFile):
        content["particles"]["file"] = PARTICLE_TABLE  # what the run folder calls its copy
    return content


def _flat(content: Any, path: str = "") -> dict[str, Any]:
    """Return all values of nested mappings by the paths of their keys."""
    if not isinstance(content, Mapping):
        return {path: content}
    values: dict[str, Any] = {}
    for key, value in content.items():
        values |= _flat(value, f"{path}.{key}" if path else key)
    return values


def _changed_particles(kept: Case, asked: Case, folder: Path) -> list[str]:
    files = [
        case_folder / case.particles.file
        for case, case_folder in ((kept, folder), (asked, asked.folder))
        if isinstance(case.particles, ParticlesFromFile)
    ]
    try:
        if len(files) < 2 or filecmp.cmp(*files, shallow=False):
            return []
    except OSError as error:
        return [f"particles.file: {error}"]
    return [f"particles.file: {files[1]} is not what it was when the run began"]


def _with_duration(kept: Case, asked: Case, as_it_was: Case) -> Case:
    content = kept.model_dump(mode="json")
    content["title"] = asked.title
    content["time"]["duration"] = asked.time.duration
    content["output"]["restart_interval"] = as_it_was.output.restart_interval
    case = parse_case(content, kept.folder)
    if abs(case.timestep - kept.timestep) > 1e-9 * kept.timestep:
        raise CaseError(
            f"time.duration: must be a whole number of {kept.timestep!r} s, the steps of LAMMPS"
            f" in the run to go on with, got {case.time.duration!r}"
        )
    return case
