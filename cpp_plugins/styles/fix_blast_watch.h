// fix blast/watch: stops a run that has become unstable, and says where, when and what to try.

#ifndef BLAST_STYLES_FIX_BLAST_WATCH_H
#define BLAST_STYLES_FIX_BLAST_WATCH_H

#include "vector3.h"

#include "fix.h"

#include <string>
#include <utility>

namespace LAMMPS_NS {

class FixBlastWatch : public Fix {
public:
  FixBlastWatch(class LAMMPS *, int, char **);

  int setmask() override;
  void init() override;
  void setup(int) override;
  void post_integrate() override;
  void end_of_step() override;
  double compute_vector(int) override;
  void write_restart(FILE *) override;
  void restart(char *) override;

private:
  void measure_drift();
  bool all_move_well() const;
  bool move_well(int first, int end) const;
  void stop_at_motion(int i) const;
  void stop_at_no_number(int i) const;
  void check_forces() const;
  void check_overlap();
  std::pair<tagint, tagint> swallowed_pair() const;
  void check_count() const;
  std::string lost_atoms() const;
  void check_energy();
  double kinetic_energy() const;
  tagint fastest_particle() const;
  std::string advice() const;

  double strain_limit = 0.9;
  double energy_limit = 0.0; // part of the largest kinetic energy; zero: not watched
  double advised_step = 0.0;
  std::string energy_variable;
  class PairBlastContact *pair = nullptr;
  class FixNVEImplicit *integrator = nullptr; // where its steps, not LAMMPS's, are those to advise
  bool particles_touch = false;               // whether any pair style knows contacts
  blast::Vector3 drift;                       // mean velocity
  bigint count_at_start = 0;
  tagint largest_id_at_start = 0;
  std::pair<tagint, tagint> swallowed_at_start{0, 0};
  double largest_kinetic = 0.0, created = 0.0, deepest = 0.0;
};

} // namespace LAMMPS_NS

#endif
