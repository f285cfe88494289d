// fix blast/losses: cumulative energy lost in contacts, channel by channel, and the work of all
// pair forces. It counts the work on the discrete motion, so that a ledger closes to the error of
// the conservative forces alone.

#ifndef BLAST_STYLES_FIX_BLAST_LOSSES_H
#define BLAST_STYLES_FIX_BLAST_LOSSES_H

#include "energy_tally.h"
#include "pair_blast_contact.h"
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

  // For fix nve/implicit, which takes steps of its own and tells of each: between the two calls no
  // atom may change its place. Velocities and spins are the means over the step, three numbers an
  // atom; `new_part` is the part of the step in which the forces of the last evaluation act, those
  // at the beginning act in the rest.
  void begin_step();
  void count_step(double step, double new_part, const double *velocity, const double *spin);

private:
  enum Channel { DAMPING, FRICTION, BOND_FRICTION, BOND_FORMATION, PAIR_WORK, CHANNELS };

  using Tally = EnergyTally<CHANNELS>;

  // Of all pair styles together, by local index.
  struct PairForces {
    std::vector<blast::Vector3> force, torque;
  };

  // A change of velocities by the present forces: how long it takes, and how far ahead of the
  // present velocities its middle lies (behind, where negative), both in s.
  struct Kick {
    double length, middle;
  };
  Kick closing_kick() const;
  Kick opening_kick() const;

  void count(const Kick &, Tally &) const;
  template <class Motion>
  void count_contacts(const ContactParts &, double length, const Motion &, Tally &) const;
  template <class Motion>
  Tally counted_contacts(const std::vector<Contact> &, double length, const Motion &) const;
  template <class Motion>
  void count_pair_forces(const PairForces &, double length, const Motion &, Tally &) const;
  template <class Motion> void count_new_bonds(double length, const Motion &);
  void count_formation();
  void close_step();
  Tally counted_by_now() const;

  PairBlastContact *pair = nullptr;
  bool counts_pair_work = false;
  bool is_told = false; // of steps, by fix nve/implicit
  bool turns = false;   // whether particles have spins and torques
  // Length of the last step, where the kick that ended it is not counted yet, else zero.
  double closing_due = 0.0;
  double heat_counted = 0.0; // of the pair style's formation heat
  Tally tally;
  PairForces pair_forces; // of the last evaluation
  PairForces pair_forces_at_beginning;
  ContactParts contacts_at_beginning;
};

} // namespace LAMMPS_NS

#endif
