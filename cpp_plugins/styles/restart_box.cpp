#include "restart_box.h"

#include "atom.h"
#include "domain.h"
#include "error.h"
#include "lammps.h"

#include <algorithm>
#include <cmath>

// How far the box reaches beyond the outermost centres: boxes must not be flat.
static double margin_of(const double *low, const double *high, double largest_radius)
{
  if (largest_radius > 0.0) return largest_radius;
  double extent = 0.0;
  for (int k = 0; k < 3; k++) extent = std::max(extent, high[k] - low[k]);
  return extent > 0.0 ? 1.0e-3 * extent : 1.0;
}

void LAMMPS_NS::draw_box_in(LAMMPS *lmp)
{
  Domain *domain = lmp->domain;
  if (domain->triclinic)
    lmp->error->all(FLERR, "Restart files of lammps-blast are for boxes that are not triclinic");
  const Atom *atom = lmp->atom;
  double here[7], farthest[7];
  std::fill(here, here + 7, -HUGE_VAL);
  for (int i = 0; i < atom->nlocal; i++) {
    for (int k = 0; k < 3; k++) {
      here[k] = std::max(here[k], -atom->x[i][k]);
      here[3 + k] = std::max(here[3 + k], atom->x[i][k]);
    }
    if (atom->radius_flag) here[6] = std::max(here[6], atom->radius[i]);
  }
  MPI_Allreduce(here, farthest, 7, MPI_DOUBLE, MPI_MAX, lmp->world);
  if (farthest[0] == -HUGE_VAL) return; // nothing to draw it in to
  const double low[] = {-farthest[0], -farthest[1], -farthest[2]}, *high = farthest + 3;
  const double margin = margin_of(low, high, farthest[6]);

  const double lowest[] = {domain->minxlo, domain->minylo, domain->minzlo};
  const double highest[] = {domain->minxhi, domain->minyhi, domain->minzhi};
  for (int k = 0; k < 3; k++) {
    // LAMMPS's numbers of boundaries: 2 follows the atoms, 3 does so down to a least size.
    const int at_low = domain->boundary[k][0], at_high = domain->boundary[k][1];
    if (at_low >= 2) domain->boxlo[k] = low[k] - margin;
    if (at_high >= 2) domain->boxhi[k] = high[k] + margin;
    if (at_low == 3) domain->boxlo[k] = std::min(domain->boxlo[k], lowest[k]);
    if (at_high == 3) domain->boxhi[k] = std::max(domain->boxhi[k], highest[k]);
  }
  domain->set_initial_box(0);
  domain->set_global_box();
  domain->reset_box();
}
