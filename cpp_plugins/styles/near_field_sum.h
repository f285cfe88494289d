// Direct summation of the near field over all pairs of some particles, in vector loops.

#ifndef BLAST_STYLES_NEAR_FIELD_SUM_H
#define BLAST_STYLES_NEAR_FIELD_SUM_H

#include "near_field.h"
#include "vector3.h"

#include <cstddef>
#include <vector>

namespace LAMMPS_NS {

// Particles by columns.
struct FieldSources {
  std::vector<double> x, y, z;
  std::vector<double> factor; // of alpha_ij = alpha * factor_i * factor_j

  void resize(size_t count);
  void set(size_t k, const double *position, double factor);
  blast::Vector3 place(int k) const { return {x[k], y[k], z[k]}; }
};

// A run of consecutive particles.
struct Range {
  int begin, end;

  bool empty() const { return begin >= end; }
  int size() const { return end - begin; }
};

// Forces per factor of the particle that they act on: its own factor is still to be multiplied.
struct FieldForces {
  std::vector<double> x, y, z;

  void clear(size_t count);
};

// Adds what the particles of a range do to each other; returns the smallest square of a distance.
double sum_among(const blast::NearField &, const FieldSources &, Range, FieldForces &);

// Adds what the particles of two ranges, which do not overlap, do to each other; returns the
// smallest square of a distance.
double sum_between(const blast::NearField &, const FieldSources &, Range, Range, FieldForces &);

// Adds what the sources of a range do to the targets of another; the two do not overlap. Returns
// the smallest square of a distance.
double sum_from(const blast::NearField &, const FieldSources &targets, Range target_range,
                const FieldSources &sources, Range source_range, FieldForces &on_targets);

// Adds the potentials, per factor of the target, of the sources of a range at the targets of
// another, to `potential` by index of the target. A target does not meet itself.
void sum_potential_from(const blast::NearField &, const FieldSources &targets, Range target_range,
                        const FieldSources &sources, Range source_range, double *potential);

} // namespace LAMMPS_NS

#endif
