"""The energy ledger against time: energies, what was exchanged, what is missing."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lammps_blast.analysis import EnergyLedger
from lammps_blast.figures.sampling import Sampling
from lammps_blast.figures.style import (
    BLUE,
    GREEN,
    ORANGE,
    PURPLE,
    STYLE,
    Unit,
    column_of_panels,
    draw_magnitudes,
    finish_stack,
    largest_of,
)

if TYPE_CHECKING:
    from lammps_blast.analyze import Analyses, Check

SERIES: dict[str, dict[str, Any]] = {
    "kinetic": {"color": BLUE, "linestyle": "-", "marker": "o", "markersize": 2.4},
    "rotational": {"color": GREEN, "linestyle": "--", "marker": "^", "markersize": 2.4},
    # Larger and hollow, as it can be hidden behind the work that it comes from.
    "change of kinetic energy": {
        "color": BLUE, "linestyle": "-", "marker": "o", "markersize": 4.0,
        "markerfacecolor": "white",
    },
    "work of E": {"color": ORANGE, "linestyle": "-.", "marker": "s", "markersize": 2.4},
    "lost to drag": {"color": PURPLE, "linestyle": "--", "marker": "^", "markersize": 2.4},
}  # fmt: skip


@rc_context(STYLE)
def energy_figure(analyses: Analyses) -> Figure:
    """Draw the energy ledger against time; without one, the energies in the trajectory."""
    ledger = analyses.ledger
    energies = ledger or analyses.energy.results
    joined = _may_be_joined(analyses)
    remarks = list(_remarks(analyses, joined))
    figure, panels = column_of_panels(analyses, remarks, *((3, 4.5) if ledger else (1, 1.9)))
    clock = Unit.of(float(energies.times[-1]), "s")
    seconds = energies.times / clock.size
    series = {"kinetic": energies.kinetic, "rotational": energies.rotational}
    unit = _draw_energies(panels[0], seconds, series, joined, "energy")
    panels[0].set_ylim(0.0, 1.15 * (largest_of(*series.values()) / unit.size or 1.0))
    if ledger:
        changes = {
            "change of kinetic energy": ledger.kinetic + ledger.rotational - ledger.launch_energy,
            "work of E": ledger.electric_work,
            "lost to drag": ledger.drag_loss,
        }
        _draw_energies(panels[1], seconds, changes, joined, "since launch")
        panels[1].axhline(0.0, color="0.8", linewidth=0.5, zorder=0)
        _draw_errors(panels[2], seconds, ledger, analyses.checks.get("energy_ledger"))
    finish_stack(panels, clock, energies.times)
    return figure


def _remarks(analyses: Analyses, joined: bool) -> Iterator[str]:
    if analyses.ledger is None:
        yield "from the trajectory; no energy table"
        if "mass" not in analyses.universe.trajectory[0].data:
            yield "masses unknown: 1 kg each"
    if not joined:
        yield Sampling.of(analyses).warning


def _may_be_joined(analyses: Analyses) -> bool:
    """Tell whether a line through energies is honest: only E and a wind make them swing."""
    case = analyses.case
    swings = case is None or any((*case.fields.electric, *case.medium.velocity))
    return not swings or Sampling.of(analyses).resolved


def _draw_energies(
    axes: Axes, seconds: np.ndarray, series: dict[str, np.ndarray], joined: bool, what: str
) -> Unit:
    """Plot energies (name: values, J), but for accounts that stay empty; return the unit."""
    unit = Unit.of(largest_of(*series.values()), "J")
    for name, values in series.items():
        if values.any() or name == "kinetic":
            options = SERIES[name] | ({} if joined else {"linestyle": "none"})
            every = max(1, len(seconds) // 40) if joined else 1
            axes.plot(seconds, values / unit.size, markevery=every, label=name, **options)
    axes.set_ylabel(f"{what} ({unit.name})")
    if axes.lines:
        axes.legend(loc="best")
    return unit


def _draw_errors(
    axes: Axes, seconds: np.ndarray, ledger: EnergyLedger, check: Check | None
) -> None:
    known = np.isfinite(ledger.turnover) and ledger.turnover > 0.0
    scale, name = (ledger.turnover, "largest energy") if known else (1.0, "1 J")
    curves = {
        "missing from the ledger": (np.abs(ledger.residual) / scale, BLUE, "o"),
        "magnetic work": (np.abs(ledger.magnetic_work) / scale, ORANGE, "s"),
    }
    draw_magnitudes(axes, seconds, curves, check)
    axes.set_ylabel(f"error / {name}")
