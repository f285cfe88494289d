#include "fix_blast_losses.h"

#include "sphere.h"
#include "threads.h"

#include "atom.h"
#include "error.h"
#include "force.h"
#include "modify.h"
#include "update.h"
#include "utils.h"

#include <cstring>

using namespace LAMMPS_NS;
using namespace FixConst;
using blast::Vector3;

static constexpr char STYLE[] = "Fix blast/losses";

namespace {

// Mean velocities over a kick by the present forces, whose middle lies ahead of the present ones.
class KickMotion {
public:
  KickMotion(const Atom &atom_, double middle_) : atom(atom_), middle(middle_) {}

  Vector3 velocity(int i) const
  {
    const Vector3 present(atom.v[i]);
    return middle == 0.0 ? present : present + (middle / atom.rmass[i]) * Vector3(atom.f[i]);
  }

  Vector3 spin(int i) const
  {
    const Vector3 present(atom.omega[i]);
    if (middle == 0.0) return present;
    const double inertia = blast::moment_of_inertia(atom.rmass[i], atom.radius[i]);
    return present + (middle / inertia) * Vector3(atom.torque[i]);
  }

private:
  const Atom &atom;
  double middle;
};

// Mean velocities that are known.
class StepMotion {
public:
  StepMotion(const double *velocities_, const double *spins_)
      : velocities(velocities_), spins(spins_)
  {
  }

  Vector3 velocity(int i) const { return Vector3(velocities + 3 * i); }
  Vector3 spin(int i) const { return Vector3(spins + 3 * i); }

private:
  const double *velocities, *spins;
};

} // namespace

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
  return INITIAL_INTEGRATE | POST_FORCE | END_OF_STEP | POST_RUN;
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
  is_told = !modify->get_fix_by_style("^nve/implicit$").empty();
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
  if (pair) pair->formation_heat = heat_counted = 0.0;
  post_force(vflag);
}

// Defined before the fixes that add forces, this fix finds those of the pair styles alone.
void FixBlastLosses::post_force(int /*vflag*/)
{
  if (!counts_pair_work) return;
  const int nlocal = atom->nlocal;
  pair_forces.force.resize(nlocal);
  pair_forces.torque.assign(nlocal, Vector3());
  for (int i = 0; i < nlocal; i++) {
    pair_forces.force[i] = Vector3(atom->f[i]);
    if (turns) pair_forces.torque[i] = Vector3(atom->torque[i]);
  }
}

// The work of a force over a half kick is force times the mean of the velocities before and after.
// The kick that ends a step and the one that begins the next have one velocity between them, and
// the same forces: where the two are equally long their means add up to that velocity, and one look
// counts both.
void FixBlastLosses::initial_integrate(int /*vflag*/)
{
  if (is_told) return;
  const bool both = closing_due == update->dt;
  if (closing_due > 0.0 && !both) close_step();
  count(both ? Kick{update->dt, 0.0} : opening_kick(), tally);
  closing_due = 0.0;
}

void FixBlastLosses::end_of_step()
{
  if (is_told) {
    count_formation();
    return;
  }
  closing_due = update->dt;
  count_formation();
  const Kick kick = closing_kick();
  count_new_bonds(kick.length, KickMotion(*atom, kick.middle));
}

void FixBlastLosses::begin_step()
{
  count_formation();
  if (pair) contacts_at_beginning = pair->kept_contacts();
  if (counts_pair_work) pair_forces_at_beginning = pair_forces;
}

void FixBlastLosses::count_step(double step, double new_part, const double *velocity,
                                const double *spin)
{
  const StepMotion motion(velocity, spin);
  const double new_length = new_part * step, old_length = step - new_length;
  if (pair) {
    count_contacts(contacts_at_beginning, old_length, motion, tally);
    count_contacts(pair->kept_contacts(), new_length, motion, tally);
    count_new_bonds(new_length, motion);
  }
  if (counts_pair_work) {
    count_pair_forces(pair_forces_at_beginning, old_length, motion, tally);
    count_pair_forces(pair_forces, new_length, motion, tally);
  }
}

// Heat of the bonds that have formed since this was last looked at.
void FixBlastLosses::count_formation()
{
  if (!pair) return;
  tally.energy[BOND_FORMATION] += pair->formation_heat - heat_counted;
  heat_counted = pair->formation_heat;
}

// A new bond pulls already in the kick that ends the step in which it forms, a kick that belongs to
// the way there: that work is not set free as heat.
template <class Motion> void FixBlastLosses::count_new_bonds(double length, const Motion &motion)
{
  if (!pair) return;
  for (const auto &part : pair->kept_contacts())
    for (const Contact &contact : part) {
      if (!contact.has_just_bonded) continue;
      double along = dot(motion.velocity(contact.i), contact.normal);
      if (contact.j < atom->nlocal) along -= dot(motion.velocity(contact.j), contact.normal);
      tally.energy[BOND_FORMATION] -= length * contact.bond * along;
    }
}

void FixBlastLosses::post_run()
{
  close_step();
}

void FixBlastLosses::close_step()
{
  tally = counted_by_now();
  closing_due = 0.0;
}

FixBlastLosses::Tally FixBlastLosses::counted_by_now() const
{
  Tally total = tally;
  if (closing_due > 0.0) count(closing_kick(), total);
  return total;
}

FixBlastLosses::Kick FixBlastLosses::closing_kick() const
{
  return {0.5 * closing_due, -0.25 * closing_due};
}

FixBlastLosses::Kick FixBlastLosses::opening_kick() const
{
  return {0.5 * update->dt, 0.25 * update->dt};
}

void FixBlastLosses::count(const Kick &kick, Tally &total) const
{
  const KickMotion motion(*atom, kick.middle);
  if (pair) count_contacts(pair->kept_contacts(), kick.length, motion, total);
  if (counts_pair_work) count_pair_forces(pair_forces, kick.length, motion, total);
}

template <class Motion>
void FixBlastLosses::count_contacts(const ContactParts &contacts, double length,
                                    const Motion &motion, Tally &total) const
{
  const int parts = static_cast<int>(contacts.size());
  std::vector<Tally> counted(parts);
  in_threads(parts, parts, [&](int part, int /*first*/, int /*end*/) {
    counted[part] = counted_contacts(contacts[part], length, motion);
  });
  for (const Tally &part : counted) total.add(part);
}

template <class Motion>
FixBlastLosses::Tally FixBlastLosses::counted_contacts(const std::vector<Contact> &contacts,
                                                       double length, const Motion &motion) const
{
  Tally total;
  for (const Contact &contact : contacts) {
    if (contact.damping == 0.0 && contact.friction == 0.0 && contact.bond_friction == 0.0) continue;
    // How fast the two follow a unit force along the normal, and one along the tangent.
    const Vector3 turning = cross(contact.normal, contact.tangent);
    double along = 0.0, across = 0.0;
    const auto add_motion = [&](int particle, double sign, double arm) {
      const Vector3 velocity = motion.velocity(particle);
      along += sign * dot(velocity, contact.normal);
      across += sign * dot(velocity, contact.tangent);
      if (arm != 0.0) across += arm * dot(motion.spin(particle), turning);
    };
    add_motion(contact.i, 1.0, contact.arm_i);
    if (contact.j < atom->nlocal) add_motion(contact.j, -1.0, contact.arm_j);
    total.energy[DAMPING] -= length * contact.damping * along;
    total.energy[FRICTION] -= length * contact.friction * across;
    total.energy[BOND_FRICTION] -= length * contact.bond_friction * across;
  }
  return total;
}

template <class Motion>
void FixBlastLosses::count_pair_forces(const PairForces &forces, double length,
                                       const Motion &motion, Tally &total) const
{
  for (int i = 0; i < atom->nlocal; i++) {
    double power = dot(forces.force[i], motion.velocity(i));
    if (turns) power += dot(forces.torque[i], motion.spin(i));
    total.energy[PAIR_WORK] += length * power;
  }
}

double FixBlastLosses::compute_vector(int channel)
{
  return counted_by_now().total(channel, world);
}

double FixBlastLosses::memory_usage()
{
  const size_t vectors = pair_forces.force.capacity() + pair_forces.torque.capacity() +
                         pair_forces_at_beginning.force.capacity() +
                         pair_forces_at_beginning.torque.capacity();
  size_t contacts = 0;
  for (const auto &part : contacts_at_beginning) contacts += part.capacity();
  return static_cast<double>(vectors * sizeof(Vector3) + contacts * sizeof(Contact));
}

void FixBlastLosses::write_restart(FILE *fp)
{
  close_step();
  tally.write_restart(fp, world);
}

void FixBlastLosses::restart(char *buffer)
{
  tally.read_restart(buffer, world);
}
