#include "work_tally.h"

#include <cstring>

using namespace LAMMPS_NS;

double WorkTally::total(Channel channel, MPI_Comm world) const
{
  double sum = 0.0;
  MPI_Allreduce(&work[channel], &sum, 1, MPI_DOUBLE, MPI_SUM, world);
  return sum;
}

void WorkTally::write_restart(FILE *fp, MPI_Comm world) const
{
  double sum[CHANNELS];
  MPI_Allreduce(work, sum, CHANNELS, MPI_DOUBLE, MPI_SUM, world);
  int me;
  MPI_Comm_rank(world, &me);
  if (me != 0) return;
  const int size = sizeof(sum);
  fwrite(&size, sizeof(int), 1, fp);
  fwrite(sum, sizeof(double), CHANNELS, fp);
}

void WorkTally::read_restart(const char *buffer, MPI_Comm world)
{
  int me;
  MPI_Comm_rank(world, &me);
  if (me == 0) memcpy(work, buffer, sizeof(work));
}
