#include "external_fields.h"

#include "style_arguments.h"

#include "atom.h"
#include "error.h"
#include "lammps.h"
#include "update.h"
#include "utils.h"

#include <cmath>
#include <cstring>

using namespace LAMMPS_NS;
using blast::Vector3;

namespace {

Vector3 vector(LAMMPS *lmp, const char *style, char **text)
{
  return {finite_argument(lmp, style, text[0]), finite_argument(lmp, style, text[1]),
          finite_argument(lmp, style, text[2])};
}

} // namespace

ExternalFields::ExternalFields(LAMMPS *lmp, const char *style, int first, int narg, char **arg)
{
  for (int iarg = first; iarg < narg;)
    if (!read_keyword(lmp, style, iarg, narg, arg))
      lmp->error->all(FLERR, "Unknown {} keyword: {}", style, arg[iarg]);
  complete(lmp, style);
}

bool ExternalFields::read_keyword(LAMMPS *lmp, const char *style, int &iarg, int narg, char **arg)
{
  const char *keyword = arg[iarg];
  const auto require = [&](int values) { require_arguments(lmp, style, iarg, values, narg, arg); };

  if (strcmp(keyword, "magnetic") == 0) {
    require(3);
    magnetic = vector(lmp, style, &arg[iarg + 1]);
    iarg += 4;
  } else if (strcmp(keyword, "drag") == 0) {
    require(1);
    read_drag(lmp, style, iarg, narg, arg);
  } else if (strcmp(keyword, "density") == 0) {
    require(1);
    medium.density = non_negative_argument(lmp, style, "density", arg[iarg + 1]);
    density_given = true;
    iarg += 2;
  } else if (strcmp(keyword, "viscosity") == 0) {
    require(1);
    medium.viscosity = non_negative_argument(lmp, style, "viscosity", arg[iarg + 1]);
    viscosity_given = true;
    iarg += 2;
  } else if (strcmp(keyword, "velocity") == 0) {
    require(3);
    medium.velocity = vector(lmp, style, &arg[iarg + 1]);
    iarg += 4;
  } else {
    return false;
  }
  return true;
}

void ExternalFields::complete(LAMMPS *lmp, const char *style)
{
  check_medium(lmp, style);
  magnetic_strength = blast::norm(magnetic);
  if (!std::isfinite(magnetic_strength))
    lmp->error->all(FLERR, "{} magnetic field is too strong to be squared", style);
  if (magnetic_strength > 0.0) axis = (1.0 / magnetic_strength) * magnetic;
}

void ExternalFields::read_drag(LAMMPS *lmp, const char *style, int &iarg, int narg, char **arg)
{
  const char *law = arg[iarg + 1];
  iarg += 2;
  if (strcmp(law, "none") == 0) {
    medium.law = blast::DragLaw::none;
  } else if (strcmp(law, "chow") == 0) {
    medium.law = blast::DragLaw::chow;
  } else if (strcmp(law, "stokes") == 0) {
    medium.law = blast::DragLaw::stokes;
  } else if (strcmp(law, "constant") == 0) {
    if (iarg >= narg)
      utils::missing_cmd_args(FLERR, std::string(style) + " drag constant", lmp->error);
    medium.law = blast::DragLaw::constant;
    medium.drag_coefficient = non_negative_argument(lmp, style, "drag coefficient", arg[iarg]);
    ++iarg;
  } else {
    lmp->error->all(FLERR, "Unknown {} drag law: {} (none, constant, chow or stokes)", style, law);
  }
}

void ExternalFields::check_medium(LAMMPS *lmp, const char *style) const
{
  const bool needs_density =
      medium.law == blast::DragLaw::constant || medium.law == blast::DragLaw::chow;
  const bool needs_viscosity =
      medium.law == blast::DragLaw::stokes || medium.law == blast::DragLaw::chow;
  if (needs_density && !density_given)
    lmp->error->all(FLERR, "{} with this drag law needs the keyword density", style);
  if (needs_viscosity && !viscosity_given)
    lmp->error->all(FLERR, "{} with this drag law needs the keyword viscosity", style);
  if (medium.law == blast::DragLaw::chow && !(medium.density > 0.0 && medium.viscosity > 0.0))
    lmp->error->all(FLERR, "{} drag chow needs density and viscosity above zero", style);
}

void ExternalFields::check_sizes(LAMMPS *lmp, const char *style, int groupbit)
{
  const Atom *atom = lmp->atom;
  for (int i = 0; i < atom->nlocal; i++)
    if ((atom->mask[i] & groupbit) && atom->radius[i] == 0.0)
      lmp->error->one(FLERR, "{} requires extended particles: atom {} is a point", style,
                      atom->tag[i]);
}

void ExternalFields::check(LAMMPS *lmp, const char *style) const
{
  if (strcmp(lmp->update->unit_style, "si") != 0)
    lmp->error->all(FLERR, "{} requires units si", style);
  if (!lmp->atom->radius_flag || !lmp->atom->rmass_flag)
    lmp->error->all(FLERR, "{} requires atom attributes radius and rmass", style);
  if (magnetic_strength > 0.0 && !lmp->atom->q_flag)
    lmp->error->all(FLERR, "{} with a magnetic field requires atom attribute q", style);
}

void ExternalForces::add(const ExternalFields &fields, Atom &atom, int groupbit)
{
  const bool magnetised = fields.magnetic_strength > 0.0;
  drag.resize(atom.nlocal);
  magnetic.resize(atom.nlocal);
  for (int i = 0; i < atom.nlocal; i++) {
    drag[i] = magnetic[i] = Vector3();
    if (!(atom.mask[i] & groupbit)) continue;
    const Vector3 velocity(atom.v[i]);
    drag[i] = drag_force(fields.medium, atom.radius[i], velocity);
    if (magnetised) magnetic[i] = magnetic_force(atom.q[i], velocity, fields.magnetic);
    (Vector3(atom.f[i]) + drag[i] + magnetic[i]).store(atom.f[i]);
  }
}

double ExternalForces::memory_usage() const
{
  return static_cast<double>((drag.capacity() + magnetic.capacity()) * sizeof(Vector3));
}
