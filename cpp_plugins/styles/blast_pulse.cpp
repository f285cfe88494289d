#include "blast_pulse.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "group.h"
#include "update.h"
#include "utils.h"

#include <algorithm>
#include <cmath>
#include <cstring>

using namespace LAMMPS_NS;
using blast::Vector3;

void BlastPulse::command(int narg, char **arg)
{
  if (narg < 2) utils::missing_cmd_args(FLERR, "blast_pulse", error);
  if (!domain->box_exist) error->all(FLERR, "Blast_pulse command before simulation box is defined");
  if (strcmp(update->unit_style, "si") != 0) error->all(FLERR, "Blast_pulse requires units si");
  if (!atom->rmass_flag) error->all(FLERR, "Blast_pulse requires atom attribute rmass");

  const int igroup = group->find(arg[0]);
  if (igroup < 0) error->all(FLERR, "Could not find blast_pulse group {}", arg[0]);
  const double energy = utils::numeric(FLERR, arg[1], false, lmp);
  if (!(energy > 0.0) || !std::isfinite(energy))
    error->all(FLERR, "Blast_pulse energy must be above zero: {}", arg[1]);

  bigint seed = 1;
  if (narg > 2 && strcmp(arg[2], "seed") != 0)
    error->all(FLERR, "Unknown blast_pulse keyword: {}", arg[2]);
  if (narg == 3) utils::missing_cmd_args(FLERR, "blast_pulse seed", error);
  if (narg > 4) error->all(FLERR, "Unknown blast_pulse keyword: {}", arg[4]);
  if (narg == 4) seed = utils::bnumeric(FLERR, arg[3], false, lmp);
  if (seed < 0) error->all(FLERR, "Blast_pulse seed must not be negative: {}", arg[3]);

  const double total_mass = group->mass(igroup);
  if (!(total_mass > 0.0)) error->all(FLERR, "Blast_pulse group {} has no mass", arg[0]);
  double centre[3];
  group->xcm(igroup, total_mass, centre);

  const int groupbit = group->bitmask[igroup];
  const double energy_before = kinetic_energy(groupbit);
  const double speed = blast::pulse_speed(energy, total_mass);
  const double centre_radius =
      blast::centre_tolerance * (norm(Vector3(centre)) + cloud_radius(groupbit, Vector3(centre)));
  bigint central = 0;

  for (int i = 0; i < atom->nlocal; i++) {
    if (!(atom->mask[i] & groupbit)) continue;
    const Vector3 offset = unwrapped(i) - Vector3(centre);
    const double distance = norm(offset);
    const bool on_centre = distance <= centre_radius;
    if (on_centre) ++central;
    const Vector3 direction =
        on_centre ? blast::random_direction(seed, atom->tag[i]) : (1.0 / distance) * offset;
    (Vector3(atom->v[i]) + speed * direction).store(atom->v[i]);
  }

  bigint central_everywhere = 0;
  MPI_Allreduce(&central, &central_everywhere, 1, MPI_LMP_BIGINT, MPI_SUM, world);
  const double energy_after = kinetic_energy(groupbit);
  const bigint particles = group->count(igroup);
  if (comm->me != 0) return;
  if (central_everywhere > 0)
    error->warning(FLERR,
                   "{} particle(s) at the centre of mass were launched in a direction drawn from "
                   "seed {}",
                   central_everywhere, seed);
  utils::logmesg(lmp,
                 "Blast pulse: {} particles, mass {:.10g} kg, pulse speed {:.10g} m/s, kinetic "
                 "energy {:.10g} -> {:.10g} J\n",
                 particles, total_mass, speed, energy_before, energy_after);
}

Vector3 BlastPulse::unwrapped(int i) const
{
  double position[3];
  domain->unmap(atom->x[i], atom->image[i], position);
  return Vector3(position);
}

double BlastPulse::cloud_radius(int groupbit, const Vector3 &centre) const
{
  double local = 0.0, largest = 0.0;
  for (int i = 0; i < atom->nlocal; i++)
    if (atom->mask[i] & groupbit) local = std::max(local, norm(unwrapped(i) - centre));
  MPI_Allreduce(&local, &largest, 1, MPI_DOUBLE, MPI_MAX, world);
  return largest;
}

double BlastPulse::kinetic_energy(int groupbit) const
{
  double local = 0.0, total = 0.0;
  for (int i = 0; i < atom->nlocal; i++) {
    if (!(atom->mask[i] & groupbit)) continue;
    const Vector3 velocity(atom->v[i]);
    local += 0.5 * atom->rmass[i] * dot(velocity, velocity);
  }
  MPI_Allreduce(&local, &total, 1, MPI_DOUBLE, MPI_SUM, world);
  return total;
}
