// The keywords "magnetic", "drag", "density", "viscosity" and "velocity", read alike by every style
// that moves charged spheres through a uniform field and a medium, with the forces that they mean.

#ifndef BLAST_STYLES_EXTERNAL_FIELDS_H
#define BLAST_STYLES_EXTERNAL_FIELDS_H

#include "drag.h"
#include "lorentz.h"

namespace LAMMPS_NS {

class LAMMPS;

class ExternalFields {
public:
  // Reads arg[first] ... arg[narg-1]; `style` names the command in error messages.
  ExternalFields(LAMMPS *lmp, const char *style, int first, int narg, char **arg);

  // Stops LAMMPS with an error when atoms lack an attribute or units are not SI.
  void check(LAMMPS *lmp, const char *style) const;

  // Stops LAMMPS with an error when a particle of the group has no size.
  static void check_sizes(LAMMPS *lmp, const char *style, int groupbit);

  blast::Vector3 magnetic;            // B, T
  double magnetic_strength = 0.0;     // |B|
  blast::Vector3 axis{0.0, 0.0, 1.0}; // B / |B|
  blast::Medium medium;

private:
  void read_drag(LAMMPS *lmp, const char *style, int &iarg, int narg, char **arg);
  void check_medium(LAMMPS *lmp, const char *style, bool density_given, bool viscosity_given) const;
};

} // namespace LAMMPS_NS

#endif
