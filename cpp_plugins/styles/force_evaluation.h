// What LAMMPS does once a step, for an integrator that needs it more often: forces at the present
// positions, neighbour lists and ranks renewed.

#ifndef BLAST_STYLES_FORCE_EVALUATION_H
#define BLAST_STYLES_FORCE_EVALUATION_H

#include "pointers.h"

namespace LAMMPS_NS {

class ForceEvaluation : protected Pointers {
public:
  explicit ForceEvaluation(LAMMPS *lmp) : Pointers(lmp) {}

  // Stops LAMMPS with an error where forces come from what is not evaluated here.
  void check(const char *style) const;

  // Forces and torques of pair styles and fixes, without energies and virials.
  void evaluate();

  // Moves atoms to the ranks that they belong to and builds the neighbour lists anew.
  void renew_lists();

private:
  void clear_forces();
};

} // namespace LAMMPS_NS

#endif
