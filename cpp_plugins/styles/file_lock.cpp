#include "file_lock.h"

#include "comm.h"
#include "error.h"
#include "lammps.h"

#include <sys/stat.h>
#include <utility>

using namespace LAMMPS_NS;

namespace {

// Between a command and the fix that follows it in an input, nobody else can hold what was taken.
std::unique_ptr<FileLock> taken;

} // namespace

bool FileLock::is_of(const std::string &name) const
{
  struct stat own, other;
  return fstat(descriptor, &own) == 0 && stat(name.c_str(), &other) == 0 &&
         own.st_dev == other.st_dev && own.st_ino == other.st_ino;
}

void LAMMPS_NS::take_lock_for_fix(LAMMPS *lmp, const char *style, const char *name)
{
  if (lmp->comm->me != 0) return;
  taken.reset();
  try {
    taken = std::make_unique<FileLock>(name);
  } catch (const std::runtime_error &failure) {
    lmp->error->one(FLERR, "{}: {}", style, failure.what());
  }
}

std::unique_ptr<FileLock> LAMMPS_NS::lock_taken_over(const std::string &name)
{
  if (taken && taken->is_of(name)) return std::move(taken);
  return std::make_unique<FileLock>(name);
}
