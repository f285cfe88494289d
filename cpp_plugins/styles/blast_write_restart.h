// blast_write_restart: writes one of two restart files in turn, sealed, with notes on the output
// files of the run, from which blast_read_restart goes on.

#ifndef BLAST_STYLES_BLAST_WRITE_RESTART_H
#define BLAST_STYLES_BLAST_WRITE_RESTART_H

#include "command.h"

#include <string>
#include <vector>

namespace LAMMPS_NS {

class RestartNotes;

class BlastWriteRestart : public Command {
public:
  BlastWriteRestart(class LAMMPS *lmp) : Command(lmp) {}
  void command(int, char **) override;

private:
  void read_arguments(int narg, char **arg);
  void renew_lists();
  std::string older_file() const;
  RestartNotes notes();
  void note_outputs(RestartNotes &notes) const;

  std::string files[2];
  std::vector<std::string> outputs, logs, values;
};

} // namespace LAMMPS_NS

#endif
