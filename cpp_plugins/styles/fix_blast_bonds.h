// fix BLAST/BONDS: remembers with which partners each atom has an active bond. Pair style
// blast/contact makes it; the lists go with their atoms across ranks and through restart files.

#ifndef BLAST_STYLES_FIX_BLAST_BONDS_H
#define BLAST_STYLES_FIX_BLAST_BONDS_H

#include "fix.h"

#include <vector>

namespace LAMMPS_NS {

class FixBlastBonds : public Fix {
public:
  FixBlastBonds(class LAMMPS *, int, char **);
  ~FixBlastBonds() override;

  bool has_any(int i) const { return !partners[i].empty(); }
  bool has(int i, tagint partner) const;
  void form(int i, tagint partner);
  void forget(int i, tagint partner);

  // Between the two, bonds are in doubt: those that are not formed again are gone afterwards.
  void begin_review();
  void end_review();
  bool had(int i, tagint partner) const; // before the review, or now

  int setmask() override;
  void pre_exchange() override;
  void grow_arrays(int) override;
  void copy_arrays(int, int, int) override;
  void set_arrays(int) override;
  int pack_exchange(int, double *) override;
  int unpack_exchange(int, double *) override;
  int pack_restart(int, double *) override;
  void unpack_restart(int, int) override;
  int size_restart(int) override;
  int maxsize_restart() override;
  double memory_usage() override;

private:
  int most_partners() const;

  std::vector<std::vector<tagint>> partners; // by local index
  std::vector<std::vector<tagint>> doubtful; // during a review
};

} // namespace LAMMPS_NS

#endif
