"""Build backend of `pip install`: scikit-build-core, after one look for a C++ compiler."""

import os
import shutil

from scikit_build_core.build import *  # noqa: F403
from scikit_build_core.build import build_editable as _build_editable
from scikit_build_core.build import build_wheel as _build_wheel
from scikit_build_core.build import get_requires_for_build_wheel as _requires_for_wheel


def _require_compiler() -> None:
    named = os.environ.get("CXX", "").split()[:1]
    if not any(shutil.which(compiler) for compiler in named or ["c++", "g++", "clang++"]):
        missing = f"CXX={named[0]} is not there" if named else "there is none on the PATH"
        raise SystemExit(
            f"lammps-blast compiles its LAMMPS plugin with a C++17 compiler, but {missing}: "
            "install one (Debian and Ubuntu: apt install g++) and try again."
        )


def get_requires_for_build_wheel(config_settings=None):
    """Refuse early, before pip fetches what the build needs."""
    _require_compiler()
    return _requires_for_wheel(config_settings)


def build_wheel(wheel_directory, config_settings=None, metadata_directory=None):
    """Build the wheel with the plugin in it."""
    _require_compiler()
    return _build_wheel(wheel_directory, config_settings, metadata_directory)


def build_editable(wheel_directory, config_settings=None, metadata_directory=None):
    """Build the editable wheel with the plugin in it."""
    _require_compiler()
    return _build_editable(wheel_directory, config_settings, metadata_directory)
