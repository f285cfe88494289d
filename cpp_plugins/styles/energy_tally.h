// Amounts of energy that a fix has counted since it was defined, one a channel: tallied per rank,
// summed over ranks when asked for, carried through restart files.

#ifndef BLAST_STYLES_ENERGY_TALLY_H
#define BLAST_STYLES_ENERGY_TALLY_H

#include <cstdio>
#include <cstring>
#include <mpi.h>

namespace LAMMPS_NS {

template <int CHANNELS> struct EnergyTally {
  double energy[CHANNELS] = {}; // this rank's share, J

  void add(const EnergyTally &other)
  {
    for (int channel = 0; channel < CHANNELS; channel++) energy[channel] += other.energy[channel];
  }

  double total(int channel, MPI_Comm world) const
  {
    double sum = 0.0;
    MPI_Allreduce(&energy[channel], &sum, 1, MPI_DOUBLE, MPI_SUM, world);
    return sum;
  }

  // A run that goes on from a restart file has all of it there, and adds up alike if others do, too.
  void gather_on_first_rank(MPI_Comm world)
  {
    int me;
    MPI_Comm_rank(world, &me);
    double sum[CHANNELS];
    MPI_Allreduce(energy, sum, CHANNELS, MPI_DOUBLE, MPI_SUM, world);
    for (int channel = 0; channel < CHANNELS; channel++)
      energy[channel] = me == 0 ? sum[channel] : 0.0;
  }

  void write_restart(FILE *fp, MPI_Comm world)
  {
    gather_on_first_rank(world);
    int me;
    MPI_Comm_rank(world, &me);
    if (me != 0) return;
    const int size = sizeof(energy);
    fwrite(&size, sizeof(int), 1, fp);
    fwrite(energy, sizeof(double), CHANNELS, fp);
  }

  void read_restart(const char *buffer, MPI_Comm world)
  {
    int me;
    MPI_Comm_rank(world, &me);
    if (me == 0) memcpy(energy, buffer, sizeof(energy));
  }
};

// Work that drag and the magnetic field have done.
enum FieldWork { DRAG_WORK, MAGNETIC_WORK, FIELD_WORKS };
using FieldWorkTally = EnergyTally<FIELD_WORKS>;

} // namespace LAMMPS_NS

#endif
