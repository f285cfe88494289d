"""Pictures of an analysed run, as PNG files: cloud, velocities, envelope, energy, clumps, contacts.

They are the counterparts of the paper's figures 5 to 9, and more. A module a topic; each function
returns a :class:`matplotlib.figure.Figure`, which a notebook shows and :func:`draw_figures` saves.
Whatever a run lacks (theory, radii, charges, fields, velocities, an energy table, more than one
frame) is left out of the pictures, and the pictures say so.

No formula of physics stands here: what is expected comes from :mod:`lammps_blast.theory` and
:mod:`lammps_blast.interactions`.

The figures are drawn by `cloud`, `velocities`, `semi_axes` and `energy` and, of particles that
interact, by `clumps`, `contacts`, `pair_distances` and `pair_histories`, the steps of an adaptive
integrator by `steps`; `scene` holds what is drawn in space, `sampling` what frames can show of a
gyration, `style` the looks and the panels.
"""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING

from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from lammps_blast.figures.cloud import charge_figure, cloud_figure, has_both_charges
from lammps_blast.figures.clumps import clump_figure, clump_statistics_figure
from lammps_blast.figures.contacts import contact_figure
from lammps_blast.figures.energy import energy_figure
from lammps_blast.figures.pair_distances import pair_distance_figure
from lammps_blast.figures.pair_histories import pair_history_figure
from lammps_blast.figures.semi_axes import semi_axis_figure
from lammps_blast.figures.steps import step_figure
from lammps_blast.figures.style import STYLE
from lammps_blast.figures.velocities import velocity_figure

if TYPE_CHECKING:
    from lammps_blast.analyze import Analyses

__all__ = [
    "charge_figure",
    "cloud_figure",
    "clump_figure",
    "clump_statistics_figure",
    "contact_figure",
    "draw_figures",
    "energy_figure",
    "pair_distance_figure",
    "pair_history_figure",
    "semi_axis_figure",
    "step_figure",
    "velocity_figure",
]

DPI = 300


def draw_figures(analyses: Analyses, folder: Path) -> None:
    """Draw every figure of a run into a folder, as PNG files.

    `cloud.png` and `semi_axes.png`; `cloud_charges.png` for a cloud of both positive and negative
    particles; `velocities.png` where the dump has velocities; `energy.png` where it has them or
    there is an energy table; `clumps.png`, `clump_statistics.png` and
    `pair_distances.png` of particles that interact; if any of them ever touch `contacts.png`, and
    `pair_histories.png` if they are few; `steps.png` where an integrator adapted its steps.

    Raises
    ------
    OSError
        If a file cannot be written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    figures = {"cloud": cloud_figure, "semi_axes": semi_axis_figure}
    if has_both_charges(analyses):
        figures["cloud_charges"] = charge_figure
    if analyses.speeds:
        figures["velocities"] = velocity_figure
    if analyses.energy or analyses.ledger:
        figures["energy"] = energy_figure
    if analyses.clumps:
        figures |= {"clumps": clump_figure, "clump_statistics": clump_statistics_figure}
    if analyses.contacts and analyses.contacts.results.fullest:
        figures["contacts"] = contact_figure
    if analyses.distances:
        figures["pair_distances"] = pair_distance_figure
    if analyses.histories and len(analyses.histories.results.pairs):
        figures["pair_histories"] = pair_history_figure
    if analyses.steps:
        figures["steps"] = step_figure
    for name, figure in figures.items():
        _save(figure(analyses), folder / f"{name}.png")


# How many ticks an axis has is settled when a figure is saved, by the size of its font.
@rc_context(STYLE)
def _save(figure: Figure, path: Path) -> None:
    FigureCanvasAgg(figure)
    with warnings.catch_warnings():
        # A title may hold characters that the font lacks; they become boxes, which is no news.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.savefig(path, dpi=DPI, format="png")
