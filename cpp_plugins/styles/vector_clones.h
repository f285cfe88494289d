// One build serves every processor of a cluster: the loader picks, for each function marked
// BLAST_VECTOR_CLONES, the one with the widest vectors there are. What such a function calls in its
// loops is BLAST_INLINE.

#ifndef BLAST_STYLES_VECTOR_CLONES_H
#define BLAST_STYLES_VECTOR_CLONES_H

#ifdef BLAST_VECTOR_CLONES_WORK
#define BLAST_VECTOR_CLONES                                                                        \
  __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#define BLAST_INLINE inline __attribute__((always_inline))
#else
#define BLAST_VECTOR_CLONES
#define BLAST_INLINE inline
#endif

#endif
