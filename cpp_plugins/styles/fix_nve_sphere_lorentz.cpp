#include "fix_nve_sphere_lorentz.h"

#include "threads.h"

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "modify.h"
#include "update.h"
#include "utils.h"

#include <algorithm>

using namespace LAMMPS_NS;
using namespace FixConst;

static constexpr char STYLE[] = "Fix nve/sphere/lorentz";

FixNVESphereLorentz::FixNVESphereLorentz(LAMMPS *lmp, int narg, char **arg)
    : Fix(lmp, narg, arg), fields(lmp, STYLE, 3, narg, arg)
{
  fields.check(lmp, STYLE);
  if (!atom->omega_flag || !atom->torque_flag)
    error->all(FLERR, "{} requires atom attributes omega and torque", STYLE);
  time_integrate = 1;
  dynamic_group_allow = 1;
  restart_global = 1;
  vector_flag = 1;
  size_vector = FIELD_WORKS;
  global_freq = 1;
  extvector = 1;
}

int FixNVESphereLorentz::setmask()
{
  return INITIAL_INTEGRATE | FINAL_INTEGRATE;
}

void FixNVESphereLorentz::init()
{
  if (utils::strmatch(update->integrate_style, "^respa"))
    error->all(FLERR, "{} does not work with run_style respa", STYLE);
  ExternalFields::check_sizes(lmp, STYLE, groupbit);
  for (auto *other : modify->get_fix_by_style("^lorentz/drag$"))
    for (int i = 0; i < atom->nlocal; i++)
      if ((atom->mask[i] & groupbit) && (atom->mask[i] & other->groupbit))
        error->one(FLERR, "{} already applies the forces of fix {} to atom {}: remove one of them",
                   STYLE, other->id, atom->tag[i]);
}

void FixNVESphereLorentz::initial_integrate(int /*vflag*/)
{
  const double step = update->dt;
  shares.resize(comm->nthreads);
  for (ThreadShare &share : shares) share.work = DriftWork();
  for_each_block([this, step](const ParticleBlock &block, int thread) {
    ThreadShare &share = shares[thread];
    kick(block, 0.5 * step);
    const DriftWork work = drift(block, fields, share.gyrations, step);
    share.work.drag += work.drag;
    share.work.magnetic += work.magnetic;
  });
  for (const ThreadShare &share : shares) {
    tally.energy[DRAG_WORK] += share.work.drag;
    tally.energy[MAGNETIC_WORK] += share.work.magnetic;
  }
}

void FixNVESphereLorentz::final_integrate()
{
  const double step = update->dt;
  for_each_block([step](const ParticleBlock &block, int /*thread*/) { kick(block, 0.5 * step); });
}

// Cuts the particles of the group into blocks and hands them on, each thread one after another.
// Blocks begin anew at the same particles whatever the number of threads.
template <class Action> void FixNVESphereLorentz::for_each_block(const Action &action)
{
  constexpr int CAPACITY = ParticleBlock::CAPACITY;
  const int nlocal = atom->nlocal, *mask = atom->mask;
  const auto act = [&](int thread, int first_stretch, int end_stretch) {
    for (int stretch = first_stretch; stretch < end_stretch; stretch++) {
      const int limit = std::min((stretch + 1) * CAPACITY, nlocal);
      for (int first = stretch * CAPACITY; first < limit;) {
        int end = first;
        while (end < limit && (mask[end] & groupbit)) end++;
        if (end > first) action(ParticleBlock(*atom, first, end - first), thread);
        first = std::max(end, first + 1);
      }
    }
  };
  in_threads(comm->nthreads, (nlocal + CAPACITY - 1) / CAPACITY, act);
}

double FixNVESphereLorentz::compute_vector(int channel)
{
  return tally.total(channel, world);
}

void FixNVESphereLorentz::write_restart(FILE *fp)
{
  tally.write_restart(fp, world);
}

void FixNVESphereLorentz::restart(char *buffer)
{
  tally.read_restart(buffer, world);
}
