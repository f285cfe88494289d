// fix nve/sphere/lorentz: structure-preserving integration of charged spheres in a uniform magnetic
// field and a medium.

#ifndef BLAST_STYLES_FIX_NVE_SPHERE_LORENTZ_H
#define BLAST_STYLES_FIX_NVE_SPHERE_LORENTZ_H

#include "energy_tally.h"
#include "external_fields.h"
#include "fix.h"
#include "particle_block.h"

#include <vector>

namespace LAMMPS_NS {

class FixNVESphereLorentz : public Fix {
public:
  FixNVESphereLorentz(class LAMMPS *, int, char **);

  int setmask() override;
  void init() override;
  void initial_integrate(int) override;
  void final_integrate() override;
  double compute_vector(int) override;
  void write_restart(FILE *) override;
  void restart(char *) override;

private:
  // One thread's.
  struct ThreadShare {
    BlockGyrations gyrations;
    DriftWork work; // of the present step
  };

  template <class Action> void for_each_block(const Action &action);

  ExternalFields fields;
  FieldWorkTally tally;
  std::vector<ThreadShare> shares;
};

} // namespace LAMMPS_NS

#endif
