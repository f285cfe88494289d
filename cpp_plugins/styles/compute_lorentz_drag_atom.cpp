#include "compute_lorentz_drag_atom.h"

#include "atom.h"
#include "memory.h"
#include "update.h"

using namespace LAMMPS_NS;
using blast::Vector3;

static constexpr char STYLE[] = "Compute lorentz/drag/atom";

ComputeLorentzDragAtom::ComputeLorentzDragAtom(LAMMPS *lmp, int narg, char **arg)
    : Compute(lmp, narg, arg), fields(lmp, STYLE, 3, narg, arg)
{
  fields.check(lmp, STYLE);
  peratom_flag = 1;
  size_peratom_cols = 6;
}

ComputeLorentzDragAtom::~ComputeLorentzDragAtom()
{
  memory->destroy(forces);
}

void ComputeLorentzDragAtom::init()
{
  ExternalFields::check_sizes(lmp, STYLE, groupbit);
}

void ComputeLorentzDragAtom::compute_peratom()
{
  invoked_peratom = update->ntimestep;
  if (atom->nmax > capacity) {
    capacity = atom->nmax;
    memory->destroy(forces);
    memory->create(forces, capacity, size_peratom_cols, "lorentz/drag/atom:forces");
    array_atom = forces;
  }

  for (int i = 0; i < atom->nlocal; i++) {
    Vector3 magnetic, drag;
    if (atom->mask[i] & groupbit) {
      const Vector3 velocity(atom->v[i]);
      if (fields.magnetic_strength > 0.0)
        magnetic = magnetic_force(atom->q[i], velocity, fields.magnetic);
      drag = drag_force(fields.medium, atom->radius[i], velocity);
    }
    magnetic.store(&forces[i][0]);
    drag.store(&forces[i][3]);
  }
}

double ComputeLorentzDragAtom::memory_usage()
{
  return static_cast<double>(capacity) * size_peratom_cols * sizeof(double);
}
