// blast_new_run: makes a folder ready for a run that begins anew, unless another is at work in it.

#ifndef BLAST_STYLES_BLAST_NEW_RUN_H
#define BLAST_STYLES_BLAST_NEW_RUN_H

#include "command.h"

namespace LAMMPS_NS {

class BlastNewRun : public Command {
public:
  BlastNewRun(class LAMMPS *lmp) : Command(lmp) {}
  void command(int, char **) override;
};

} // namespace LAMMPS_NS

#endif
