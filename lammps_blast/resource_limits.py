"""What a case asks of the machine, and what there is: memory for particles, room for frames.

Estimates are low ones, so that nothing is refused that could be.
"""

from __future__ import annotations

import os
import resource
import shutil
from collections.abc import Iterator
from pathlib import Path

from lammps_blast.case import Case, CaseError

# Measured with clouds of 200 000 and 800 000 spheres, in bytes a particle: what packing them and
# writing their data file takes at its peak, and what LAMMPS and the analysis of its run do.
BYTES_TO_PACK, BYTES_TO_RUN = 220, 1000
# What a frame takes of a particle: eight bytes a number, or the short numbers of a text.
BYTES_IN_BINARY_FRAME, BYTES_IN_TEXT_FRAME = 80, 100
BYTES_OF_FORCES = 48

_CGROUPS = Path("/sys/fs/cgroup")
_OWN_CGROUPS = Path("/proc/self/cgroup")


def memory_limit() -> int:
    """Return how many bytes this process may use: the least of what bounds it.

    That is the machine's memory, the limit of its address space (`ulimit -v`), and the limits of
    the control groups that it is in, as a batch system or a container sets them.
    """
    machine = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    address_space, _ = resource.getrlimit(resource.RLIMIT_AS)
    limits = [machine, *_cgroup_limits()]
    if address_space != resource.RLIM_INFINITY:
        limits.append(address_space)
    return min(limits)


def _cgroup_limits() -> Iterator[int]:
    """Yield the limits of every control group that this process is in, however deep."""
    for folder, name in _cgroup_folders():
        for group in (folder, *folder.parents):
            try:
                text = (group / name).read_text(encoding="ascii").strip()
            except (OSError, ValueError):
                continue
            if text.isdecimal():  # else "max"
                yield int(text)


def _cgroup_folders() -> Iterator[tuple[Path, str]]:
    """Yield the folders of this process's memory groups, and the files there that hold limits."""
    try:
        lines = _OWN_CGROUPS.read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        return
    for line in lines:
        hierarchy, controllers, path = line.split(":", 2)
        if hierarchy == "0":
            yield _CGROUPS / path.lstrip("/"), "memory.max"
        elif "memory" in controllers.split(","):
            yield _CGROUPS / "memory" / path.lstrip("/"), "memory.limit_in_bytes"


def most_particles(bytes_each: int) -> int:
    """Return how many particles there is memory for, of so many bytes each."""
    return memory_limit() // bytes_each


def memory_shortage(count: int, bytes_each: int) -> str | None:
    """Return why there cannot be so many particles, None if there is memory for them.

    Parameters
    ----------
    count
        Their number.
    bytes_each
        :data:`BYTES_TO_PACK` or :data:`BYTES_TO_RUN`.
    """
    if count <= most_particles(bytes_each):
        return None
    return (
        f"{count} particles need at least {_amount(count * bytes_each)} of memory, and "
        f"{_amount(memory_limit())} can be had here; take fewer, or a larger machine"
    )


def output_bytes(case: Case, count: int) -> int:
    """Return how many bytes the trajectory of `count` particles takes, at least."""
    output = case.output
    each = BYTES_IN_BINARY_FRAME if output.format == "binary" else BYTES_IN_TEXT_FRAME
    if output.forces:
        each += BYTES_OF_FORCES
    return (case.timesteps // case.output_every + 1) * count * each


def check_room(case: Case, count: int, folder: Path, *, reclaimed: int = 0) -> None:
    """Refuse a run of `count` particles whose trajectory cannot fit on the disk of its folder.

    Parameters
    ----------
    folder
        It need not exist yet.
    reclaimed
        Bytes in it that are free when the run begins.

    Raises
    ------
    CaseError
        It tells how much the trajectory needs and how much there is.
    """
    needed = output_bytes(case, count)
    free = shutil.disk_usage(nearest_folder(folder)).free + reclaimed
    if needed > free:
        frames = case.timesteps // case.output_every + 1
        raise CaseError(
            f"output.interval: {frames} frames of {count} particles need at least "
            f"{_amount(needed)}, and {_amount(free)} are free where they are written; take a "
            "longer interval, `output.format: binary`, or another folder (--output)"
        )


def nearest_folder(folder: Path) -> Path:
    """Return a folder if there is one, else the lowest above it that there is."""
    return next(place for place in (folder, *folder.absolute().parents) if os.path.isdir(place))


def _amount(size: int) -> str:
    """Return a number of bytes in the largest unit of which there is one."""
    power = min(4, (size.bit_length() - 1) // 10) if size > 0 else 0
    return f"{size / 1024**power:.3g} {('bytes', 'KiB', 'MiB', 'GiB', 'TiB')[power]}"
