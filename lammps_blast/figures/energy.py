"""The energy ledger against time: energies, what was exchanged, what is missing."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from lammps_blast.analysis import EnergyLedger
from lammps_blast.figures.sampling import Sampling, plot_frames
from lammps_blast.figures.style import (
    BLUE,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    STYLE,
    Unit,
    column_of_panels,
    draw_magnitudes,
    finish_stack,
    largest_of,
    put_legend_above,
)

if TYPE_CHECKING:
    from lammps_blast.analyze import Analyses

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
    "potential": {"color": GREY, "linestyle": "-", "marker": "D", "markersize": 2.0},
    "lost": {"color": PURPLE, "linestyle": "--", "marker": "v", "markersize": 2.4},
    "contacts": {"color": ORANGE, "linestyle": "--", "marker": "s", "markersize": 2.4},
    "bonds": {"color": GREEN, "linestyle": "-.", "marker": "^", "markersize": 2.4},
    "near field": {"color": BLUE, "linestyle": "-", "marker": "o", "markersize": 2.4},
    "friction": {"color": BLUE, "linestyle": "-", "marker": "o", "markersize": 2.4},
    "drag": {"color": PURPLE, "linestyle": "-.", "marker": "v", "markersize": 2.4},
    "bonds forming": {"color": GREEN, "linestyle": ":", "marker": "^", "markersize": 2.4},
    "friction of bonds": {"color": GREY, "linestyle": "--", "marker": "D", "markersize": 2.0},
}  # fmt: skip

# A loss below such a part of the largest one has no place in a picture of both.
FAINTEST_LOSS = 1e-6


@rc_context(STYLE)
def energy_figure(analyses: Analyses) -> Figure:
    """Draw the energy ledger against time; without one, the energies in the trajectory.

    Of particles that interact: what every kind of energy gained since launch, the potential
    energies by themselves, what was lost by channel, and the error.
    """
    ledger = analyses.ledger
    if ledger and _is_of_interactions(ledger):
        return _interaction_figure(analyses, ledger)
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
        _draw_errors(panels[2], seconds, ledger, analyses)
    finish_stack(panels, clock, energies.times)
    return figure


def _is_of_interactions(ledger: EnergyLedger) -> bool:
    return bool(ledger.potential.any() or ledger.interaction_loss.any())


def _interaction_figure(analyses: Analyses, ledger: EnergyLedger) -> Figure:
    """Draw the ledger of particles that interact, in panels each with a scale of its own.

    Drag, contacts, friction and bonds may differ by many orders of magnitude.
    """
    joined = _may_be_joined(analyses)
    launch = Unit.of(ledger.launch_energy, "J").show(ledger.launch_energy, ledger.launch_energy)
    remarks = [f"kinetic energy at launch: {launch}", *_remarks(analyses, joined)]
    contact = analyses.case.contact if analyses.case else None
    if contact and contact.law != "zohdi":
        remarks.append("lost in contacts: with what their springs hold")
    changes, potentials, losses = _changes(ledger), _potentials(ledger), _losses(ledger)
    count = 2 + bool(potentials) + bool(losses)
    figure, panels = column_of_panels(analyses, remarks, count, 1.5 * count)
    clock = Unit.of(float(ledger.times[-1]), "s")
    seconds = ledger.times / clock.size
    rest = iter(panels)
    _draw_changes(next(rest), seconds, changes, joined, "since launch")
    if potentials:
        _draw_changes(next(rest), seconds, potentials, joined, "potential, change")
    if losses:
        _draw_losses(next(rest), seconds, losses, joined)
    _draw_errors(next(rest), seconds, ledger, analyses)
    finish_stack(panels, clock, ledger.times)
    return figure


def _changes(ledger: EnergyLedger) -> dict[str, np.ndarray]:
    """Return what each kind of energy gained since launch, and what came and went, J."""
    changes = {
        "kinetic": ledger.kinetic - ledger.kinetic[0],
        "rotational": ledger.rotational - ledger.rotational[0],
        "potential": ledger.potential - ledger.potential[0],
        "work of E": ledger.electric_work,
        "lost": ledger.drag_loss + ledger.interaction_loss,
    }
    return _not_empty(changes)


def _potentials(ledger: EnergyLedger) -> dict[str, np.ndarray]:
    """Return what each potential energy gained since launch, J."""
    potentials = {
        "contacts": ledger.contact_energy,
        "bonds": ledger.bond_energy,
        "near field": ledger.near_field_energy,
    }
    return _not_empty({name: values - values[0] for name, values in potentials.items()})


def _losses(ledger: EnergyLedger) -> dict[str, np.ndarray]:
    """Return what was lost since launch, by channel, J."""
    losses = {
        "drag": ledger.drag_loss,
        "contacts": ledger.contact_loss,
        "friction": ledger.friction_loss,
        "bonds forming": ledger.bond_formation_loss,
        "friction of bonds": ledger.bond_friction_loss,
    }
    return _not_empty(losses)


def _not_empty(accounts: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    return {name: values for name, values in accounts.items() if values.any()}


def _remarks(analyses: Analyses, joined: bool) -> Iterator[str]:
    if analyses.ledger is None:
        yield "from the trajectory; no energy table"
        if not analyses.cloud.has_mass:
            yield "masses unknown: 1 kg each"
    if not joined:
        yield Sampling.of(analyses).warning


def _may_be_joined(analyses: Analyses) -> bool:
    """Tell whether a line through energies is honest: a magnetic field alone lets none swing."""
    case = analyses.case
    swings = case is None or case.interacts
    swings = swings or any((*case.fields.electric, *case.medium.velocity))
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
    else:
        text = "exactly zero:\n" + "\n".join(series)
        axes.text(0.02, 0.9, text, transform=axes.transAxes, fontsize=7.0, va="top")
    return unit


def _draw_changes(
    axes: Axes, seconds: np.ndarray, series: dict[str, np.ndarray], joined: bool, what: str
) -> None:
    """Plot changes of energies (name: values, J) about zero."""
    unit = Unit.of(largest_of(*series.values()), "J")
    for name, values in series.items():
        look = SERIES["change of kinetic energy" if name == "kinetic" else name]
        plot_frames(axes, seconds, values / unit.size, joined, label=name, **look)
    axes.axhline(0.0, color="0.8", linewidth=0.5, zorder=0)
    axes.set_ylabel(f"{what} ({unit.name})")
    put_legend_above(axes)


def _draw_losses(
    axes: Axes, seconds: np.ndarray, losses: dict[str, np.ndarray], joined: bool
) -> None:
    """Plot losses (name: values, J) on a log axis; on a linear one if any was taken back.

    Losses that are as good as nothing beside the largest are named, but not drawn.
    """
    largest = largest_of(*losses.values())
    floor = FAINTEST_LOSS * largest
    if any(np.any(values < -floor) for values in losses.values()):
        _draw_changes(axes, seconds, losses, joined, "lost")
        return
    faint = [name for name, values in losses.items() if largest_of(values) < floor]
    shown = {
        name: np.where(values >= floor, values, np.nan)
        for name, values in losses.items() if name not in faint
    }  # fmt: skip
    for name, values in shown.items():
        plot_frames(axes, seconds, values, joined, label=name, **SERIES[name])
    axes.set_yscale("log")
    axes.yaxis.set_major_locator(LogLocator(numticks=6))
    axes.yaxis.set_minor_locator(NullLocator())
    # A decade at least, so that a tick has a number.
    top = 3.0 * largest
    axes.set_ylim(min(0.5 * min(map(np.nanmin, shown.values())), 0.05 * top), top)
    axes.set_ylabel("lost (J)")
    put_legend_above(axes)
    if faint:
        text = f"{', '.join(faint)}: less than {floor:.0e} J"
        axes.text(0.99, 0.04, text, transform=axes.transAxes, fontsize=6.5, ha="right")


def _draw_errors(axes: Axes, seconds: np.ndarray, ledger: EnergyLedger, analyses: Analyses) -> None:
    known = np.isfinite(ledger.turnover) and ledger.turnover > 0.0
    scale, name = (ledger.turnover, "largest energy") if known else (1.0, "1 J")
    curves = {
        "missing from the ledger": (np.abs(ledger.residual) / scale, BLUE, "o"),
        "magnetic work": (np.abs(ledger.magnetic_work) / scale, ORANGE, "s"),
    }
    checks = {
        "missing from the ledger": analyses.checks.get("energy_ledger"),
        "magnetic work": analyses.checks.get("magnetic_work"),
    }
    draw_magnitudes(axes, seconds, curves, checks)
    axes.set_ylabel(f"error / {name}")
