// The keywords "magnetic", "drag", "density", "viscosity" and "velocity", read alike by every style
// that moves charged spheres through a uniform field and a medium, and the forces that they mean.

#ifndef BLAST_STYLES_EXTERNAL_FIELDS_H
#define BLAST_STYLES_EXTERNAL_FIELDS_H

#include "drag.h"
#include "lorentz.h"

#include <vector>

namespace LAMMPS_NS {

class Atom;
class LAMMPS;

class ExternalFields {
public:
  ExternalFields() = default;

  // Reads arg[first] ... arg[narg-1]; `style` names the command in error messages.
  ExternalFields(LAMMPS *lmp, const char *style, int first, int narg, char **arg);

  // Reads the keyword at arg[iarg] with its values and moves iarg behind them; false if it is not
  // one of the five.
  bool read_keyword(LAMMPS *lmp, const char *style, int &iarg, int narg, char **arg);

  // To be called once when all keywords have been read.
  void complete(LAMMPS *lmp, const char *style);

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
  void check_medium(LAMMPS *lmp, const char *style) const;

  bool density_given = false, viscosity_given = false;
};

// Magnetic force and drag on the spheres of a group, by local index: those of the last evaluation,
// as long as no atom changes its place.
struct ExternalForces {
  std::vector<blast::Vector3> drag, magnetic;

  // Works them out from the present velocities and adds them to LAMMPS's forces.
  void add(const ExternalFields &fields, Atom &atom, int groupbit);

  double memory_usage() const;
};

} // namespace LAMMPS_NS

#endif
