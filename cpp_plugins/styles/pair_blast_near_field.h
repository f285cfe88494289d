// pair_style blast/nearfield: attraction and repulsion by real powers of the distance, cut off with
// a neighbour list, or summed over all pairs without one, directly or by tree.

#ifndef BLAST_STYLES_PAIR_BLAST_NEAR_FIELD_H
#define BLAST_STYLES_PAIR_BLAST_NEAR_FIELD_H

#include "all_pairs_sum.h"
#include "near_field.h"
#include "vector3.h"

#include "pair.h"

#include <memory>
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
  void allocate();
  blast::NearField &field(int itype, int jtype) { return fields[itype * (types + 1) + jtype]; }
  SummationMethod method_argument(const char *) const;
  void set_up_sum();
  void work_out_factors();
  const int *sign_property() const;
  double factor_of(int i, const int *sign) const;
  void compute_by_list();
  void compute_all_pairs();
  void tally_all_pairs();
  void tally_pair_by_pair();
  void report_approximation();
  void stop_at_coincidence(tagint first, tagint second);
  void find_coincidence();

  bool all_pairs = false;
  double cutoff = 0.0, switch_width = 0.0;
  blast::Scaling scaling = blast::Scaling::mass;
  std::string signs; // name of a per-atom property, or empty
  int types = 0;
  std::vector<blast::NearField> fields;
  std::vector<char> is_ours;   // by types, whether a hybrid style leaves the pair to this one
  std::vector<double> factors; // by local index, ghosts too
  SummationMethod method = SummationMethod::direct;
  double accuracy = 0.0; // of a sum that need not be direct
  std::unique_ptr<AllPairsSum> sum;
};

} // namespace LAMMPS_NS

#endif
