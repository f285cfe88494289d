#include "force_evaluation.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "force.h"
#include "modify.h"
#include "neighbor.h"
#include "pair.h"
#include "timer.h"
#include "update.h"

#include <cstring>

using namespace LAMMPS_NS;

static constexpr int NO_VIRIAL = 0, NO_ENERGY = 0;

void ForceEvaluation::check(const char *style) const
{
  if (atom->molecular != Atom::ATOMIC) error->all(FLERR, "{} does not work with molecules", style);
  if (force->kspace) error->all(FLERR, "{} does not work with kspace_style", style);
  if (domain->triclinic) error->all(FLERR, "{} does not work with a triclinic box", style);
  if (neighbor->includegroup)
    error->all(FLERR, "{} does not work with neigh_modify include", style);
}

void ForceEvaluation::evaluate()
{
  timer->stamp(Timer::MODIFY);
  comm->forward_comm();
  timer->stamp(Timer::COMM);
  clear_forces();
  modify->pre_force(NO_VIRIAL);
  timer->stamp(Timer::MODIFY);
  if (force->pair && force->pair->compute_flag) {
    force->pair->compute(NO_ENERGY, NO_VIRIAL);
    timer->stamp(Timer::PAIR);
  }
  modify->pre_reverse(NO_ENERGY, NO_VIRIAL);
  if (force->newton) {
    comm->reverse_comm();
    timer->stamp(Timer::COMM);
  }
  modify->post_force(NO_VIRIAL);
  timer->stamp(Timer::MODIFY);
}

void ForceEvaluation::clear_forces()
{
  const size_t count = atom->nlocal + (force->newton ? atom->nghost : 0);
  if (count == 0) return;
  memset(&atom->f[0][0], 0, 3 * count * sizeof(double));
  if (atom->torque_flag) memset(&atom->torque[0][0], 0, 3 * count * sizeof(double));
}

void ForceEvaluation::renew_lists()
{
  timer->stamp(Timer::MODIFY);
  modify->pre_exchange();
  domain->pbc();
  if (domain->box_change) {
    domain->reset_box();
    comm->setup();
    if (neighbor->style) neighbor->setup_bins();
  }
  comm->exchange();
  if (atom->sortfreq > 0 && update->ntimestep >= atom->nextsort) atom->sort();
  comm->borders();
  timer->stamp(Timer::COMM);
  modify->pre_neighbor();
  neighbor->build(1);
  modify->post_neighbor();
  timer->stamp(Timer::NEIGH);
}
