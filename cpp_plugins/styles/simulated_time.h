// The time that LAMMPS shows as `time` in thermo output, in s.

#ifndef BLAST_STYLES_SIMULATED_TIME_H
#define BLAST_STYLES_SIMULATED_TIME_H

#include "update.h"

namespace LAMMPS_NS {

inline double simulated_time(const Update &update)
{
  return update.atime + static_cast<double>(update.ntimestep - update.atimestep) * update.dt;
}

} // namespace LAMMPS_NS

#endif
