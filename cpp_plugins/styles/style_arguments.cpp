#include "style_arguments.h"

#include "error.h"
#include "lammps.h"
#include "utils.h"

#include <cmath>
#include <string>

namespace LAMMPS_NS {

double finite_argument(LAMMPS *lmp, const char *style, const char *text)
{
  const double value = utils::numeric(FLERR, text, false, lmp);
  if (!std::isfinite(value))
    lmp->error->all(FLERR, "{} argument {} is not a finite number", style, text);
  return value;
}

double non_negative_argument(LAMMPS *lmp, const char *style, const char *keyword, const char *text)
{
  const double value = finite_argument(lmp, style, text);
  if (value < 0.0) lmp->error->all(FLERR, "{} {} must not be negative: {}", style, keyword, text);
  return value;
}

double positive_argument(LAMMPS *lmp, const char *style, const char *keyword, const char *text)
{
  const double value = finite_argument(lmp, style, text);
  if (value <= 0.0) lmp->error->all(FLERR, "{} {} must be above zero: {}", style, keyword, text);
  return value;
}

void require_arguments(LAMMPS *lmp, const char *style, int iarg, int values, int narg, char **arg)
{
  if (iarg + values >= narg)
    utils::missing_cmd_args(FLERR, std::string(style) + " " + arg[iarg], lmp->error);
}

} // namespace LAMMPS_NS
