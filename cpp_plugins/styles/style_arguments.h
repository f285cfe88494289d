// Numbers among the arguments of a style, checked; `style` names the command in error messages.

#ifndef BLAST_STYLES_STYLE_ARGUMENTS_H
#define BLAST_STYLES_STYLE_ARGUMENTS_H

namespace LAMMPS_NS {

class LAMMPS;

double finite_argument(LAMMPS *lmp, const char *style, const char *text);
double non_negative_argument(LAMMPS *lmp, const char *style, const char *keyword, const char *text);
double positive_argument(LAMMPS *lmp, const char *style, const char *keyword, const char *text);

// Reads the atom types, of so many, that an argument of pair_coeff names.
void type_range(LAMMPS *lmp, const char *style, const char *text, int types, int &low, int &high);

// Stops LAMMPS when fewer than `values` arguments follow the keyword arg[iarg].
void require_arguments(LAMMPS *lmp, const char *style, int iarg, int values, int narg, char **arg);

} // namespace LAMMPS_NS

#endif
