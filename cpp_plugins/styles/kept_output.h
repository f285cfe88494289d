// Output that a run goes on with, where LAMMPS would begin it anew: it opens binary dumps so that
// what they held is lost. Until then that is kept under another name.

#ifndef BLAST_STYLES_KEPT_OUTPUT_H
#define BLAST_STYLES_KEPT_OUTPUT_H

#include <string>

namespace LAMMPS_NS {

// Whether LAMMPS takes a dump of this name for a binary one.
bool is_binary_dump(const std::string &name);

// Puts a file out of LAMMPS's way.
void keep_output(const std::string &name);

// Forgets a file that an earlier run has put away, where a run begins anew.
void forget_kept_output(const std::string &name);

// Takes a file back that a run has put away and not gone on with.
void take_output_back(const std::string &name);

// Has the file that LAMMPS has opened anew be the one that was kept, with its end to write to.
// Throws std::runtime_error if this process has not opened it.
void go_on_with_output(const std::string &name);

} // namespace LAMMPS_NS

#endif
