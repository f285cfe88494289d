// fix blast/losses: cumulative energy lost in contacts, channel by channel, and the work of all
// pair forces. It counts the work on the discrete motion, so that a ledger closes to the error of
// the conservative forces alone.

#ifndef BLAST_STYLES_FIX_BLAST_LOSSES_H
#define BLAST_STYLES_FIX_BLAST_LOSSES_H

#include "energy_tally.h"
#include "vector3.h"

#include "fix.h"

#include <vector>

namespace LAMMPS_NS {

class FixBlastLosses : public Fix {
public:
  FixBlastLosses(class LAMMPS *, int, char **);

  int setmask() override;
  void init() override;
  void setup(int) override;
  void initial_integrate(int) override;
  void post_force(int) override;
  void end_of_step() override;
  double compute_vector(int) override;
  double memory_usage() override;
  void write_restart(FILE *) override;
  void restart(char *) override;

private:
  enum Channel { DAMPING, FRICTION, BOND_FRICTION, BOND_FORMATION, PAIR_WORK, CHANNELS };

  struct MeanMotion {
    blast::Vector3 velocity, spin;
  };

  void tally_half_kick(double sign);
  void tally_contacts(double sign);
  void tally_pair_forces(double sign);
  MeanMotion mean_motion(int i, double sign) const;

  class PairBlastContact *pair = nullptr;
  bool counts_pair_work = false;
  bool turns = false;        // whether particles have spins and torques
  double heat_counted = 0.0; // of the pair style's formation heat
  EnergyTally<CHANNELS> tally;
  std::vector<blast::Vector3> pair_force, pair_torque; // of the last evaluation, by local index
};

} // namespace LAMMPS_NS

#endif
