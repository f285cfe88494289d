// blast_read_restart: goes on from the newest whole restart file of blast_write_restart, and cuts
// the output files of the run back to what they held then.

#ifndef BLAST_STYLES_BLAST_READ_RESTART_H
#define BLAST_STYLES_BLAST_READ_RESTART_H

#include "restart_seal.h"

#include "command.h"

#include <optional>

namespace LAMMPS_NS {

class BlastReadRestart : public Command {
public:
  BlastReadRestart(class LAMMPS *lmp) : Command(lmp) {}
  void command(int, char **) override;

private:
  struct Chosen {
    std::string file;
    RestartNotes notes;
  };

  void read_arguments(int narg, char **arg);
  Chosen newest_whole() const;
  Chosen told_to_all(Chosen chosen) const;
  void check_versions(const Chosen &chosen) const;
  void arrange_ranks(const RestartNotes &notes) const;
  void restore_box(const RestartNotes &notes) const;
  void restore_clock(const RestartNotes &notes) const;
  void restore_values(const RestartNotes &notes) const;
  void check_step() const;
  void cut_outputs_back(const RestartNotes &notes) const;

  std::vector<std::string> files;
  double step = 0.0;               // that is expected; zero: any
  std::optional<bigint> last_step; // that the run is to come to
};

} // namespace LAMMPS_NS

#endif
