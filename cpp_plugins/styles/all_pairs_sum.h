// The near field summed over all pairs of particles of all ranks, directly or by tree, by all ranks
// and threads together.

#ifndef BLAST_STYLES_ALL_PAIRS_SUM_H
#define BLAST_STYLES_ALL_PAIRS_SUM_H

#include "cartesian_expansion.h"
#include "gathered_particles.h"
#include "near_field.h"
#include "near_field_sum.h"
#include "near_field_tree.h"

#include "pointers.h"

#include <functional>
#include <memory>
#include <vector>

namespace LAMMPS_NS {

enum class SummationMethod { direct, tree, automatic };

class AllPairsSum : protected Pointers {
public:
  using FieldOfTypes = std::function<const blast::NearField &(int, int)>;

  AllPairsSum(class LAMMPS *, SummationMethod, double accuracy, FieldOfTypes);

  // Finds forces and, if asked for, potentials. Returns whether two centres coincide.
  bool compute(const std::vector<double> &factors, bool energies);

  // What the last summation found for a particle of ours, per its factor.
  blast::Vector3 force_on(int i) const;
  double potential_of(int i) const { return potentials[particles.own_place[i]]; }

  // How the last summation was done; of a direct one the order is zero.
  struct Approximation {
    int order = 0;
    double opening = 0.0;
    double error = 0.0; // root mean square of the force's, over that of the force, measured
  };
  const Approximation &approximation() const { return used; }

  // Between particles of a type and those of a group of everyone().
  const blast::NearField &field_on(int type, int group) const
  {
    return field_of_types(type, type_of_group[group]);
  }

  const GatheredParticles &everyone() const { return particles; }
  double memory_usage() const;

  // The next sum chooses as the first one does: a run depends on nothing that was before it.
  void forget_choice();

private:
  struct Trial {
    Approximation approximation;
    double cost; // in interactions of one particle with one other
  };

  void group_types();
  const blast::NearField &field_between(int group, int other) const;
  Range share_of(const NearFieldTree &) const;
  void grow_trees();
  void expand_trees();
  int first_rung() const;
  bool is_time_to_choose() const;
  void choose();
  void sample_leaves();
  void find_sampled_forces();
  bool find_cheapest_trial(Trial &);
  Trial try_rung(int rung);
  double cost_of_direct_sum() const;
  bool use(const Approximation &, double cost);
  double sum_directly();
  double sum_block(Range);
  double sum_blocks(Range, Range);
  void find_potentials_directly();
  double sum_by_tree(bool energies);

  const SummationMethod method;
  const double accuracy;
  const FieldOfTypes field_of_types;

  GatheredParticles particles;
  std::vector<int> group_of_type, type_of_group;
  FieldForces forces;
  std::vector<double> potentials;

  struct SampledLeaf {
    int group, leaf;
  };
  std::vector<NearFieldTree> trees; // by group
  std::unique_ptr<CartesianExpansion> expansion;
  std::vector<SampledLeaf> sample; // those of this rank
  FieldForces sampled_forces;      // summed directly, on the sample
  Approximation used;
  int rung;
  bigint chosen_at = -1; // the step
  int chosen_for = 0;    // particles
  bool is_announced = false;
};

} // namespace LAMMPS_NS

#endif
