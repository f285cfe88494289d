// The particles of all ranks on each of them, for sums over all pairs: sorted into groups of atom
// types whose particles feel and exert the same near field.

#ifndef BLAST_STYLES_GATHERED_PARTICLES_H
#define BLAST_STYLES_GATHERED_PARTICLES_H

#include "near_field_sum.h"

#include "pointers.h"

#include <mpi.h>
#include <vector>

namespace LAMMPS_NS {

class GatheredParticles : protected Pointers {
public:
  explicit GatheredParticles(class LAMMPS *lmp) : Pointers(lmp) {}

  // Settles who is where, as long as no particle changes ranks; `group_of_type` by atom type.
  void arrange(const std::vector<int> &group_of_type, int groups);

  // Sets positions and factors from those of all ranks, by local index on each.
  void gather(const std::vector<double> &factors);

  // Moves particles: order[k] is where the one is that shall be at `first` + k.
  void reorder(int first, const std::vector<int> &order);

  // Adds up what the ranks have each found for all particles.
  void add_up_ranks(std::vector<double> &column) const;

  int count() const { return static_cast<int>(sources.x.size()); }
  double memory_usage() const;

  FieldSources sources;
  std::vector<Range> groups;  // in `sources`
  std::vector<tagint> tag;    // by place in `sources`
  std::vector<int> own_place; // in `sources`, by local index

private:
  template <class Number>
  std::vector<Number> gathered(const std::vector<Number> &ours, int each, MPI_Datatype) const;
  void find_own_places();

  std::vector<int> counts, offsets; // of particles gathered from each rank
  std::vector<int> place;           // in `sources`, of each particle gathered
};

} // namespace LAMMPS_NS

#endif
