// One build serves every processor of a cluster: functions marked here exist in several versions,
// and the widest vectors there are get used. What such a function calls in its loops is
// BLAST_INLINE.
//
// BLAST_VECTOR_CLONES: the loader picks among all versions.
// BLAST_NARROW_CLONES and BLAST_WIDE: two functions, for processors without and with vectors of
// 64 bytes, between which has_wide_vectors() tells; for loops that are written differently for
// them.

#ifndef BLAST_STYLES_VECTOR_CLONES_H
#define BLAST_STYLES_VECTOR_CLONES_H

#ifdef BLAST_VECTOR_CLONES_WORK
#define BLAST_VECTOR_CLONES                                                                        \
  __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#define BLAST_NARROW_CLONES __attribute__((target_clones("arch=x86-64-v3", "default")))
#define BLAST_WIDE __attribute__((target("arch=x86-64-v4")))
#define BLAST_INLINE inline __attribute__((always_inline))
#else
#define BLAST_VECTOR_CLONES
#define BLAST_NARROW_CLONES
#define BLAST_WIDE
#define BLAST_INLINE inline
#endif

namespace LAMMPS_NS {

inline bool has_wide_vectors()
{
#ifdef BLAST_VECTOR_CLONES_WORK
  return __builtin_cpu_supports("x86-64-v4");
#else
  return false;
#endif
}

// The version of the marked functions that this processor gets.
inline const char *vector_level()
{
#ifdef BLAST_VECTOR_CLONES_WORK
  if (has_wide_vectors()) return "x86-64-v4";
  if (__builtin_cpu_supports("x86-64-v3")) return "x86-64-v3";
#endif
  return "default";
}

} // namespace LAMMPS_NS

#endif
