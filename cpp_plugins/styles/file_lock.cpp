#include "file_lock.h"

#include "comm.h"
#include "error.h"
#include "lammps.h"

void LAMMPS_NS::require_unlocked(LAMMPS *lmp, const char *style, const char *name)
{
  if (lmp->comm->me != 0) return;
  try {
    const FileLock free(name);
  } catch (const std::runtime_error &failure) {
    lmp->error->one(FLERR, "{}: {}", style, failure.what());
  }
}
