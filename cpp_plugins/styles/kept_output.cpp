#include "kept_output.h"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <stdexcept>
#include <sys/stat.h>
#include <unistd.h>

using namespace LAMMPS_NS;
namespace files = std::filesystem;

namespace {

std::string kept_name(const std::string &name)
{
  return name + ".kept";
}

bool ends_with(const std::string &name, const std::string &end)
{
  return name.size() >= end.size() && name.compare(name.size() - end.size(), end.size(), end) == 0;
}

// The descriptor under which this process has opened a file; -1 if it has not.
int descriptor_of(const std::string &name)
{
  struct stat wanted, found;
  if (stat(name.c_str(), &wanted) != 0) return -1;
  for (const auto &entry : files::directory_iterator("/dev/fd")) {
    const int descriptor = std::stoi(entry.path().filename().string());
    if (fstat(descriptor, &found) == 0 && found.st_dev == wanted.st_dev &&
        found.st_ino == wanted.st_ino)
      return descriptor;
  }
  return -1;
}

} // namespace

bool LAMMPS_NS::is_binary_dump(const std::string &name)
{
  return ends_with(name, ".bin") || ends_with(name, ".lammpsbin");
}

void LAMMPS_NS::keep_output(const std::string &name)
{
  files::rename(name, kept_name(name));
}

void LAMMPS_NS::forget_kept_output(const std::string &name)
{
  files::remove(kept_name(name));
}

void LAMMPS_NS::take_output_back(const std::string &name)
{
  if (files::exists(kept_name(name))) files::rename(kept_name(name), name);
}

void LAMMPS_NS::go_on_with_output(const std::string &name)
{
  const std::string kept = kept_name(name);
  if (!files::exists(kept)) return;
  const int opened = descriptor_of(name);
  if (opened < 0) throw std::runtime_error("no dump has opened " + name);
  const int at_its_end = open(kept.c_str(), O_WRONLY | O_APPEND | O_CLOEXEC);
  const bool is_done = at_its_end >= 0 && dup2(at_its_end, opened) >= 0;
  const int reason = errno;
  if (at_its_end >= 0) close(at_its_end);
  if (!is_done) throw std::runtime_error("cannot go on with " + kept + ": " + strerror(reason));
  files::rename(kept, name);
}
