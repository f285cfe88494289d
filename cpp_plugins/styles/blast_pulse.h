// blast_pulse: gives a group the radial pulse of a stated energy about its centre of mass.

#ifndef BLAST_STYLES_BLAST_PULSE_H
#define BLAST_STYLES_BLAST_PULSE_H

#include "command.h"
#include "pulse.h"

namespace LAMMPS_NS {

class BlastPulse : public Command {
public:
  BlastPulse(class LAMMPS *lmp) : Command(lmp) {}
  void command(int, char **) override;

private:
  blast::Vector3 unwrapped(int i) const;
  double cloud_radius(int groupbit, const blast::Vector3 &centre) const;
  double kinetic_energy(int groupbit) const;
};

} // namespace LAMMPS_NS

#endif
