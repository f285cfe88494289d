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

// What is no integer makes utils::bounds throw what LAMMPS does not catch.
void type_range(LAMMPS *lmp, const char *style, const char *text, int types, int &low, int &high)
{
  const std::string range = text;
  const bool is_range = utils::strmatch(range, "^\\d+$") || utils::strmatch(range, "^\\d*\\*\\d*$");
  if (!is_range || range.size() > 9)
    lmp->error->all(FLERR, "{} has no atom types {}", style, range);
  utils::bounds(FLERR, range, 1, types, low, high, lmp->error);
}

void require_arguments(LAMMPS *lmp, const char *style, int iarg, int values, int narg, char **arg)
{
  if (iarg + values >= narg)
    utils::missing_cmd_args(FLERR, std::string(style) + " " + arg[iarg], lmp->error);
}

} // namespace LAMMPS_NS
