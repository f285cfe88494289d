// A lock on a file that one process at a time can hold, and loses when it ends, however it ends.

#ifndef BLAST_STYLES_FILE_LOCK_H
#define BLAST_STYLES_FILE_LOCK_H

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <memory>
#include <stdexcept>
#include <string>
#include <sys/file.h>
#include <unistd.h>

namespace LAMMPS_NS {

class LAMMPS;

class FileLock {
public:
  FileLock() = default;

  // Throws std::runtime_error if another process holds it, or it cannot be made.
  explicit FileLock(const std::string &name)
      : descriptor(open(name.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0666))
  {
    if (descriptor < 0) throw std::runtime_error("cannot open " + name + ": " + strerror(errno));
    // On a file system without locks there is none to be had: a run goes on without.
    if (flock(descriptor, LOCK_EX | LOCK_NB) == 0 || errno != EWOULDBLOCK) return;
    close(descriptor);
    throw std::runtime_error("another LAMMPS is at work in this folder: it holds " + name);
  }

  ~FileLock()
  {
    if (descriptor >= 0) close(descriptor);
  }

  // Whether that is the file, by whatever name it was locked.
  bool is_of(const std::string &name) const;

  FileLock(const FileLock &) = delete;
  FileLock &operator=(const FileLock &) = delete;

private:
  int descriptor = -1;
};

// Takes a lock on the first rank, for a fix to take over; stops LAMMPS while another process holds
// it. `style` names the command that asks.
void take_lock_for_fix(LAMMPS *lmp, const char *style, const char *name);

// The lock that a command has taken, or one taken now. Throws std::runtime_error as the lock does.
std::unique_ptr<FileLock> lock_taken_over(const std::string &name);

} // namespace LAMMPS_NS

#endif
