// The box as it is in a run that goes on from a restart file: a function of where atoms are, not of
// how the box came to be, so that an interrupted run goes on bit by bit as one that was not.

#ifndef BLAST_STYLES_RESTART_BOX_H
#define BLAST_STYLES_RESTART_BOX_H

namespace LAMMPS_NS {

class LAMMPS;

// Draws the sides that follow the cloud in to the outermost atoms, as if the box were made now.
void draw_box_in(LAMMPS *lmp);

} // namespace LAMMPS_NS

#endif
