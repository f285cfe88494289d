#include "fix_lorentz_drag.h"

#include "atom.h"
#include "error.h"
#include "update.h"
#include "utils.h"

using namespace LAMMPS_NS;
using namespace FixConst;
using blast::Vector3;

static constexpr char STYLE[] = "Fix lorentz/drag";

FixLorentzDrag::FixLorentzDrag(LAMMPS *lmp, int narg, char **arg)
    : Fix(lmp, narg, arg), fields(lmp, STYLE, 3, narg, arg)
{
  fields.check(lmp, STYLE);
  dynamic_group_allow = 1;
  restart_global = 1;
  nevery = 1;
  vector_flag = 1;
  size_vector = FIELD_WORKS;
  global_freq = 1;
  extvector = 1;
}

int FixLorentzDrag::setmask()
{
  return POST_INTEGRATE | POST_FORCE | END_OF_STEP;
}

void FixLorentzDrag::init()
{
  if (utils::strmatch(update->integrate_style, "^respa"))
    error->all(FLERR, "{} does not work with run_style respa", STYLE);
  ExternalFields::check_sizes(lmp, STYLE, groupbit);
}

void FixLorentzDrag::setup(int vflag)
{
  post_force(vflag);
}

void FixLorentzDrag::post_force(int /*vflag*/)
{
  forces.add(fields, *atom, groupbit);
}

// After the first and after the second half kick of a velocity-Verlet step the velocity has just
// gained dt/2 f/m, with the forces of the last evaluation.
void FixLorentzDrag::post_integrate()
{
  tally_half_kick();
}

void FixLorentzDrag::end_of_step()
{
  tally_half_kick();
}

// Work of a force over a kick is force times the mean of the velocities before and after. Summed
// over all forces it is the change of the kinetic energy to rounding, so the magnetic column shows
// what the time integration, not the field, does to the energy.
void FixLorentzDrag::tally_half_kick()
{
  const double half_step = 0.5 * update->dt;
  for (int i = 0; i < atom->nlocal; i++) {
    if (!(atom->mask[i] & groupbit)) continue;
    const Vector3 mean_velocity =
        Vector3(atom->v[i]) - (0.5 * half_step / atom->rmass[i]) * Vector3(atom->f[i]);
    tally.energy[DRAG_WORK] += half_step * dot(forces.drag[i], mean_velocity);
    tally.energy[MAGNETIC_WORK] += half_step * dot(forces.magnetic[i], mean_velocity);
  }
}

double FixLorentzDrag::compute_vector(int channel)
{
  return tally.total(channel, world);
}

double FixLorentzDrag::memory_usage()
{
  return forces.memory_usage();
}

void FixLorentzDrag::write_restart(FILE *fp)
{
  tally.write_restart(fp, world);
}

void FixLorentzDrag::restart(char *buffer)
{
  tally.read_restart(buffer, world);
}
