// Tells whoever asks the plugin's binary, as `lammps-blast doctor` does, how wide its vectors are.

#include "vector_clones.h"

extern "C" __attribute__((visibility("default"))) const char *lammps_blast_vector_level()
{
  return LAMMPS_NS::vector_level();
}
