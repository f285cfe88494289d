#include "restart_box.h"

#include "atom.h"
#include "domain.h"
#include "lammps.h"

#include <algorithm>
#include <cmath>

void LAMMPS_NS::draw_box_in(LAMMPS *lmp)
{
  Domain *domain = lmp->domain;
  const Atom *atom = lmp->atom;
  double here[6], farthest[6];
  std::fill(here, here + 6, -HUGE_VAL);
  for (int i = 0; i < atom->nlocal; i++)
    for (int k = 0; k < 3; k++) {
      here[k] = std::max(here[k], -atom->x[i][k]);
      here[3 + k] = std::max(here[3 + k], atom->x[i][k]);
    }
  MPI_Allreduce(here, farthest, 6, MPI_DOUBLE, MPI_MAX, lmp->world);

  const double lowest[] = {domain->minxlo, domain->minylo, domain->minzlo};
  const double highest[] = {domain->minxhi, domain->minyhi, domain->minzhi};
  for (int k = 0; k < 3; k++) {
    // LAMMPS's numbers of boundaries: 2 follows the atoms, 3 does so down to a least size.
    const int low = domain->boundary[k][0], high = domain->boundary[k][1];
    if (low >= 2) domain->boxlo[k] = -farthest[k];
    if (high >= 2) domain->boxhi[k] = farthest[3 + k];
    if (low == 3) domain->boxlo[k] = std::min(domain->boxlo[k], lowest[k]);
    if (high == 3) domain->boxhi[k] = std::max(domain->boxhi[k], highest[k]);
  }
  domain->set_initial_box(0);
  domain->set_global_box();
  domain->reset_box();
}
