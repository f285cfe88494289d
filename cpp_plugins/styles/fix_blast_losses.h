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
  void post_run() override;
  double compute_vector(int) override;
  double memory_usage() override;
  void write_restart(FILE *) override;
  void restart(char *) override;

private:
  enum Channel { DAMPING, FRICTION, BOND_FRICTION, BOND_FORMATION, PAIR_WORK, CHANNELS };

  using Tally = EnergyTally<CHANNELS>;

  // A change of velocities by the present forces: how long it takes, and how far ahead of the
  // present velocities its middle lies (behind, where negative), both in s.
  struct Kick {
    double length, middle;
  };
  Kick closing_kick() const;
  Kick opening_kick() const;

  void count(const Kick &, Tally &) const;
  void count_contacts(const Kick &, Tally &) const;
  void count_pair_forces(const Kick &, Tally &) const;
  void count_formation();
  void close_step();
  Tally counted_by_now() const;
  blast::Vector3 mean_velocity(int i, double middle) const;
  blast::Vector3 mean_spin(int i, double middle) const;

  class PairBlastContact *pair = nullptr;
  bool counts_pair_work = false;
  bool turns = false; // whether particles have spins and torques
  // Length of the last step, where the kick that ended it is not counted yet, else zero.
  double closing_due = 0.0;
  double heat_counted = 0.0; // of the pair style's formation heat
  Tally tally;
  std::vector<blast::Vector3> pair_force, pair_torque; // of the last evaluation, by local index
};

} // namespace LAMMPS_NS

#endif
