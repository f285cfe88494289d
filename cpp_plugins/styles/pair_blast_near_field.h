// pair_style blast/nearfield: attraction and repulsion by real powers of the distance, cut off with
// a neighbour list, or summed over all pairs without one.

#ifndef BLAST_STYLES_PAIR_BLAST_NEAR_FIELD_H
#define BLAST_STYLES_PAIR_BLAST_NEAR_FIELD_H

#include "near_field.h"
#include "near_field_sum.h"
#include "vector3.h"

#include "pair.h"

#include <mpi.h>
#include <string>
#include <vector>

namespace LAMMPS_NS {

class PairBlastNearField : public Pair {
public:
  explicit PairBlastNearField(class LAMMPS *);
  ~PairBlastNearField() override;

  void compute(int, int) override;
  void settings(int, char **) override;
  void coeff(int, char **) override;
  void init_style() override;
  double init_one(int, int) override;
  void write_restart(FILE *) override;
  void read_restart(FILE *) override;
  void write_restart_settings(FILE *) override;
  void read_restart_settings(FILE *) override;
  double single(int, int, int, int, double, double, double, double &) override;
  double memory_usage() override;

private:
  // The particles of all ranks for the sum over all pairs: sorted by type and, within a type, by
  // rank, so that all of one type, and our own among them, lie in a row.
  struct Everyone {
    FieldSources sources;
    std::vector<tagint> tag;
    std::vector<Range> of_type, own_of_type; // in `sources`
    Range share;                             // of this rank in the work, in `sources`
    std::vector<int> own;                    // our local indices, by type
    std::vector<int> counts, offsets;        // of particles gathered from each rank
    std::vector<int> place;                  // in `sources`, of each particle gathered
  };

  void allocate();
  blast::NearField &field(int itype, int jtype) { return fields[itype * (types + 1) + jtype]; }
  void work_out_factors();
  const int *sign_property() const;
  double factor_of(int i, const int *sign) const;
  void compute_by_list();
  void compute_all_pairs();
  void arrange_everyone();
  void gather_everyone();
  template <class Number>
  std::vector<Number> gathered(const std::vector<Number> &ours, int each, MPI_Datatype) const;
  Range share_of(int rank) const;
  double sum_share();
  void collect_forces();
  void tally_all_pairs();
  [[noreturn]] void stop_at_coincidence(tagint first, tagint second);
  [[noreturn]] void find_coincidence();

  bool all_pairs = false;
  double cutoff = 0.0, switch_width = 0.0;
  blast::Scaling scaling = blast::Scaling::mass;
  std::string signs; // name of a per-atom property, or empty
  int types = 0;
  std::vector<blast::NearField> fields;
  std::vector<double> factors; // by local index, ghosts too
  Everyone everyone;
  FieldForces forces;
};

} // namespace LAMMPS_NS

#endif
