// fix lorentz/drag: adds the magnetic force and the drag of a medium to the forces on charged
// spheres, for any time integrator.

#ifndef BLAST_STYLES_FIX_LORENTZ_DRAG_H
#define BLAST_STYLES_FIX_LORENTZ_DRAG_H

#include "energy_tally.h"
#include "external_fields.h"
#include "fix.h"

namespace LAMMPS_NS {

class FixLorentzDrag : public Fix {
public:
  FixLorentzDrag(class LAMMPS *, int, char **);

  int setmask() override;
  void init() override;
  void setup(int) override;
  void post_force(int) override;
  void post_integrate() override;
  void end_of_step() override;
  double compute_vector(int) override;
  double memory_usage() override;
  void write_restart(FILE *) override;
  void restart(char *) override;

private:
  void tally_half_kick();

  ExternalFields fields;
  FieldWorkTally tally;
  ExternalForces forces;
};

} // namespace LAMMPS_NS

#endif
