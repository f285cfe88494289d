// Work that drag and the magnetic field have done on a fix's group since it was defined: tallied
// per rank, summed over ranks when asked for, carried through restart files.

#ifndef BLAST_STYLES_WORK_TALLY_H
#define BLAST_STYLES_WORK_TALLY_H

#include <cstdio>
#include <mpi.h>

namespace LAMMPS_NS {

struct WorkTally {
  enum Channel { DRAG, MAGNETIC, CHANNELS };

  double work[CHANNELS] = {0.0, 0.0}; // this rank's share, J

  double total(Channel channel, MPI_Comm world) const;
  void write_restart(FILE *fp, MPI_Comm world) const;
  void read_restart(const char *buffer, MPI_Comm world);
};

} // namespace LAMMPS_NS

#endif
