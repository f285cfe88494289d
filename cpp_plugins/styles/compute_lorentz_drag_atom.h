// compute lorentz/drag/atom: magnetic and drag force on each sphere in its present state.

#ifndef BLAST_STYLES_COMPUTE_LORENTZ_DRAG_ATOM_H
#define BLAST_STYLES_COMPUTE_LORENTZ_DRAG_ATOM_H

#include "compute.h"
#include "external_fields.h"

namespace LAMMPS_NS {

class ComputeLorentzDragAtom : public Compute {
public:
  ComputeLorentzDragAtom(class LAMMPS *, int, char **);
  ~ComputeLorentzDragAtom() override;

  void init() override;
  void compute_peratom() override;
  double memory_usage() override;

private:
  ExternalFields fields;
  int capacity = 0;
  double **forces = nullptr;
};

} // namespace LAMMPS_NS

#endif
