#include "fix_nve_sphere_lorentz.h"

#include "sphere.h"

#include "atom.h"
#include "error.h"
#include "modify.h"
#include "update.h"
#include "utils.h"

#include <cmath>

using namespace LAMMPS_NS;
using namespace FixConst;
using blast::Vector3;

static constexpr char STYLE[] = "Fix nve/sphere/lorentz";

static inline bool any_component(const double *vector)
{
  return (vector[0] != 0.0) | (vector[1] != 0.0) | (vector[2] != 0.0);
}

FixNVESphereLorentz::FixNVESphereLorentz(LAMMPS *lmp, int narg, char **arg)
    : Fix(lmp, narg, arg), fields(lmp, STYLE, 3, narg, arg)
{
  fields.check(lmp, STYLE);
  time_integrate = 1;
  dynamic_group_allow = 1;
  restart_global = 1;
  vector_flag = 1;
  size_vector = WorkTally::CHANNELS;
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
  for (auto *other : modify->get_fix_by_style("^lorentz/drag$"))
    if (other->igroup == igroup)
      error->all(FLERR, "{} already applies the forces of fix {}: remove one of them", STYLE,
                 other->id);

  for (int i = 0; i < atom->nlocal; i++)
    if ((atom->mask[i] & groupbit) && atom->radius[i] == 0.0)
      error->one(FLERR, "{} requires extended particles: atom {} is a point", STYLE, atom->tag[i]);
}

void FixNVESphereLorentz::initial_integrate(int /*vflag*/)
{
  half_kick();
  drift_all();
}

void FixNVESphereLorentz::final_integrate()
{
  half_kick();
}

// Forces and torques of everything that LAMMPS itself computes, over half a step. Most particles of
// a cloud feel none, and looking costs less than dividing.
void FixNVESphereLorentz::half_kick()
{
  const double half_step = 0.5 * update->dt;
  const int nlocal = atom->nlocal, *mask = atom->mask;
  const double *mass = atom->rmass, *radius = atom->radius;
  double **v = atom->v, **f = atom->f, **omega = atom->omega, **torque = atom->torque;

  for (int i = 0; i < nlocal; i++) {
    if (!(mask[i] & groupbit)) continue;
    if (any_component(f[i])) {
      const double gain = half_step / mass[i];
      for (int k = 0; k < 3; k++) v[i][k] += gain * f[i][k];
    }
    if (any_component(torque[i])) {
      const double gain = half_step / blast::moment_of_inertia(mass[i], radius[i]);
      for (int k = 0; k < 3; k++) omega[i][k] += gain * torque[i][k];
    }
  }
}

void FixNVESphereLorentz::drift_all()
{
  const double step = update->dt;
  const blast::Medium medium = fields.medium;
  const Vector3 axis = fields.axis;
  ParticleBlock block;
  for (int i = 0; i < atom->nlocal;) {
    i = gather(block, i);
    const DriftWork work = drift(block, medium, axis, step);
    tally.work[WorkTally::DRAG] += work.drag;
    tally.work[WorkTally::MAGNETIC] += work.magnetic;
    for (int j = 0; j < block.count; j++) {
      block.position(j).store(atom->x[block.index[j]]);
      block.velocity(j).store(atom->v[block.index[j]]);
    }
  }
}

// Fills a block with particles of the group from local index i on; returns where it stopped.
int FixNVESphereLorentz::gather(ParticleBlock &block, int i)
{
  const double step = update->dt, strength = fields.magnetic_strength;
  const int *mask = atom->mask;
  const double *rmass = atom->rmass, *radius = atom->radius, *q = atom->q;
  double **x = atom->x, **v = atom->v;

  int j = 0;
  for (; i < atom->nlocal && j < ParticleBlock::CAPACITY; i++) {
    if (!(mask[i] & groupbit)) continue;
    block.index[j] = i;
    block.set_position(j, Vector3(x[i]));
    block.set_velocity(j, Vector3(v[i]));
    block.mass[j] = rmass[i];
    block.inverse_mass[j] = 1.0 / rmass[i];
    block.radius[j] = radius[i];
    if (strength > 0.0) {
      const double angle =
          step * blast::cyclotron_frequency(q[i], block.inverse_mass[j], strength);
      if (std::fabs(angle) != last_angle) { // one sine for clouds of one charge-to-mass ratio
        last_angle = std::fabs(angle);
        last_gyration = blast::Gyration(last_angle);
      }
      block.gyration[j] = angle < 0.0 ? last_gyration.reversed() : last_gyration;
    }
    j++;
  }
  block.count = j;
  return i;
}

double FixNVESphereLorentz::compute_vector(int channel)
{
  return tally.total(static_cast<WorkTally::Channel>(channel), world);
}

void FixNVESphereLorentz::write_restart(FILE *fp)
{
  tally.write_restart(fp, world);
}

void FixNVESphereLorentz::restart(char *buffer)
{
  tally.read_restart(buffer, world);
}
