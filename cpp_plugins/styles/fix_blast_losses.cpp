#include "fix_blast_losses.h"

#include "pair_blast_contact.h"
#include "sphere.h"

#include "atom.h"
#include "error.h"
#include "force.h"
#include "modify.h"
#include "update.h"
#include "utils.h"

#include <cstring>
#include <utility>

using namespace LAMMPS_NS;
using namespace FixConst;
using blast::Vector3;

static constexpr char STYLE[] = "Fix blast/losses";

FixBlastLosses::FixBlastLosses(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg)
{
  if (narg != 3 && !(narg == 5 && strcmp(arg[3], "work") == 0))
    error->all(FLERR, "{} takes no arguments but: work yes or no", STYLE);
  if (narg == 5) counts_pair_work = utils::logical(FLERR, arg[4], false, lmp) == 1;
  if (strcmp(arg[1], "all") != 0) error->all(FLERR, "{} requires group all", STYLE);
  if (!atom->radius_flag || !atom->rmass_flag)
    error->all(FLERR, "{} requires atom attributes radius and rmass", STYLE);
  turns = atom->omega_flag && atom->torque_flag;
  restart_global = 1;
  nevery = 1;
  vector_flag = 1;
  size_vector = CHANNELS;
  global_freq = 1;
  extvector = 1;
}

int FixBlastLosses::setmask()
{
  return INITIAL_INTEGRATE | POST_FORCE | END_OF_STEP;
}

void FixBlastLosses::init()
{
  if (utils::strmatch(update->integrate_style, "^respa"))
    error->all(FLERR, "{} does not work with run_style respa", STYLE);
  for (const auto &fix : modify->get_fix_list()) {
    if (fix == this) break;
    if (fix->time_integrate)
      error->all(FLERR, "{} must be defined before fix {}, which integrates", STYLE, fix->id);
  }
  pair = static_cast<PairBlastContact *>(force->pair_match("blast/contact", 1));
  if (pair) {
    pair->keep_contacts();
  } else if (!counts_pair_work) {
    error->all(FLERR, "{} requires pair style blast/contact, or the keyword: work yes", STYLE);
  }
}

void FixBlastLosses::setup(int vflag)
{
  // Bonds that are there at the start are part of it.
  if (pair) heat_counted = pair->formation_heat;
  post_force(vflag);
}

// Defined before the fixes that add forces, this fix finds those of the pair styles alone.
void FixBlastLosses::post_force(int /*vflag*/)
{
  if (!counts_pair_work) return;
  const int nlocal = atom->nlocal;
  pair_force.resize(nlocal);
  pair_torque.assign(nlocal, Vector3());
  for (int i = 0; i < nlocal; i++) {
    pair_force[i] = Vector3(atom->f[i]);
    if (atom->torque_flag) pair_torque[i] = Vector3(atom->torque[i]);
  }
}

void FixBlastLosses::initial_integrate(int /*vflag*/)
{
  tally_half_kick(1.0);
}

void FixBlastLosses::end_of_step()
{
  tally_half_kick(-1.0);
  if (!pair) return;
  tally.energy[BOND_FORMATION] += pair->formation_heat - heat_counted;
  heat_counted = pair->formation_heat;
}

// The work of a force over the half kick that begins (sign +1) or ends (-1) at the present
// velocity: force times the mean of the velocities before and after the kick.
void FixBlastLosses::tally_half_kick(double sign)
{
  if (pair) tally_contacts(sign);
  if (counts_pair_work) tally_pair_forces(sign);
}

FixBlastLosses::MeanMotion FixBlastLosses::mean_motion(int i, double sign) const
{
  const double quarter = 0.25 * sign * update->dt, mass = atom->rmass[i];
  MeanMotion mean;
  mean.velocity = Vector3(atom->v[i]) + (quarter / mass) * Vector3(atom->f[i]);
  if (!turns) return mean;
  const double inertia = blast::moment_of_inertia(mass, atom->radius[i]);
  mean.spin = Vector3(atom->omega[i]) + (quarter / inertia) * Vector3(atom->torque[i]);
  return mean;
}

void FixBlastLosses::tally_contacts(double sign)
{
  const double half_step = 0.5 * update->dt;
  for (const Contact &contact : pair->kept_contacts()) {
    if (contact.damping == 0.0 && contact.friction == 0.0 && contact.bond_friction == 0.0) continue;
    // How fast the particle follows a unit force along the normal, and one along the tangent.
    const Vector3 turning = cross(contact.normal, contact.tangent);
    const auto speeds = [&](int particle, double arm) {
      const MeanMotion mean = mean_motion(particle, sign);
      return std::pair<double, double>{dot(mean.velocity, contact.normal),
                                       dot(mean.velocity, contact.tangent) +
                                           arm * dot(mean.spin, turning)};
    };
    auto [along, across] = speeds(contact.i, contact.arm_i);
    if (contact.j < atom->nlocal) {
      const auto [along_j, across_j] = speeds(contact.j, -contact.arm_j);
      along -= along_j;
      across -= across_j;
    }
    tally.energy[DAMPING] -= half_step * contact.damping * along;
    tally.energy[FRICTION] -= half_step * contact.friction * across;
    tally.energy[BOND_FRICTION] -= half_step * contact.bond_friction * across;
  }
}

void FixBlastLosses::tally_pair_forces(double sign)
{
  const double half_step = 0.5 * update->dt;
  for (int i = 0; i < atom->nlocal; i++) {
    const MeanMotion mean = mean_motion(i, sign);
    tally.energy[PAIR_WORK] +=
        half_step * (dot(pair_force[i], mean.velocity) + dot(pair_torque[i], mean.spin));
  }
}

double FixBlastLosses::compute_vector(int channel)
{
  return tally.total(channel, world);
}

double FixBlastLosses::memory_usage()
{
  return static_cast<double>((pair_force.capacity() + pair_torque.capacity()) * sizeof(Vector3));
}

void FixBlastLosses::write_restart(FILE *fp)
{
  tally.write_restart(fp, world);
}

void FixBlastLosses::restart(char *buffer)
{
  tally.read_restart(buffer, world);
}
