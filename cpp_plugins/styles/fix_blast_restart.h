// fix blast/restart: ends a run after the present step when a signal asks for it, keeps a second
// LAMMPS out of the folder, and remembers which frames dumps have written.

#ifndef BLAST_STYLES_FIX_BLAST_RESTART_H
#define BLAST_STYLES_FIX_BLAST_RESTART_H

#include "file_lock.h"

#include "fix.h"

#include <memory>
#include <string>
#include <vector>

namespace LAMMPS_NS {

class FixBlastRestart : public Fix {
public:
  FixBlastRestart(class LAMMPS *, int, char **);
  ~FixBlastRestart() override;

  int setmask() override;
  void setup(int) override;
  void end_of_step() override;
  void write_restart(FILE *) override;
  void restart(char *) override;

  // As a signal does; may be called at any time, from any thread.
  static void ask_to_stop(int signal);

private:
  void take_lock(const char *name);
  void listen();
  int signal_of_any_rank();

  std::unique_ptr<FileLock> lock;
  bool goes_on = false;               // from a restart file
  std::vector<bigint> frames_written; // the step of each dump's last frame
  std::vector<std::string> binary_dumps;
  int steps_to_look = 1, steps_of_look = 1; // of several ranks, together
  double last_look = 0.0;                   // s, of a clock
};

} // namespace LAMMPS_NS

#endif
