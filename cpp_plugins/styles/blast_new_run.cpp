#include "blast_new_run.h"

#include "file_lock.h"

#include "comm.h"
#include "error.h"
#include "utils.h"

#include <cstring>
#include <filesystem>

using namespace LAMMPS_NS;

static constexpr char STYLE[] = "Blast_new_run";

// Restart files of an earlier run would pass for those of this one where they tell of later steps.
void BlastNewRun::command(int narg, char **arg)
{
  if (narg < 3) utils::missing_cmd_args(FLERR, "blast_new_run", error);
  if (strcmp(arg[narg - 2], "lock") != 0)
    error->all(FLERR, "{} needs at its end: lock and the name of a file", STYLE);
  take_lock_for_fix(lmp, STYLE, arg[narg - 1]);
  if (comm->me != 0) return;
  for (int iarg = 0; iarg < narg - 2; iarg++) {
    std::error_code failure;
    std::filesystem::remove(arg[iarg], failure);
    if (failure) error->one(FLERR, "{} cannot remove {}: {}", STYLE, arg[iarg], failure.message());
  }
}
