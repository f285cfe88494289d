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

namespace {

blast::Vector3 vector(LAMMPS *lmp, const char *style, char **text)
{
  return {finite_argument(lmp, style, text[0]), finite_argument(lmp, style, text[1]),
          finite_argument(lmp, style, text[2])};
}

} // namespace

ExternalFields::ExternalFields(LAMMPS *lmp, const char *style, int first, int narg, char **arg)
{
  bool density_given = false, viscosity_given = false;
  const auto require = [&](int iarg, int values) {
    require_arguments(lmp, style, iarg, values, narg, arg);
  };

  int iarg = first;
  while (iarg < narg) {
    if (strcmp(arg[iarg], "magnetic") == 0) {
      require(iarg, 3);
      magnetic = vector(lmp, style, &arg[iarg + 1]);
      iarg += 4;
    } else if (strcmp(arg[iarg], "drag") == 0) {
      require(iarg, 1);
      read_drag(lmp, style, iarg, narg, arg);
    } else if (strcmp(arg[iarg], "density") == 0) {
      require(iarg, 1);
      medium.density = non_negative_argument(lmp, style, "density", arg[iarg + 1]);
      density_given = true;
      iarg += 2;
    } else if (strcmp(arg[iarg], "viscosity") == 0) {
      require(iarg, 1);
      medium.viscosity = non_negative_argument(lmp, style, "viscosity", arg[iarg + 1]);
      viscosity_given = true;
      iarg += 2;
    } else if (strcmp(arg[iarg], "velocity") == 0) {
      require(iarg, 3);
      medium.velocity = vector(lmp, style, &arg[iarg + 1]);
      iarg += 4;
    } else {
      lmp->error->all(FLERR, "Unknown {} keyword: {}", style, arg[iarg]);
    }
  }

  check_medium(lmp, style, density_given, viscosity_given);
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

void ExternalFields::check_medium(LAMMPS *lmp, const char *style, bool density_given,
                                  bool viscosity_given) const
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
