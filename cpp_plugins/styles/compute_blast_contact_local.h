// compute blast/contact/local: a row for each contact of pair style blast/contact.

#ifndef BLAST_STYLES_COMPUTE_BLAST_CONTACT_LOCAL_H
#define BLAST_STYLES_COMPUTE_BLAST_CONTACT_LOCAL_H

#include "compute.h"

namespace LAMMPS_NS {

class ComputeBlastContactLocal : public Compute {
public:
  ComputeBlastContactLocal(class LAMMPS *, int, char **);
  ~ComputeBlastContactLocal() override;

  void init() override;
  void compute_local() override;
  double memory_usage() override;

private:
  class PairBlastContact *pair = nullptr;
  int rows = 0; // that there is room for
};

} // namespace LAMMPS_NS

#endif
