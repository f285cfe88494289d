#include "particle_block.h"

#include <algorithm>

using namespace LAMMPS_NS;
using blast::Medium;
using blast::Vector3;

// One build serves every processor of a cluster: the loader picks the widest vectors there are.
#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__)
#define BLAST_VECTOR_CLONES                                                                        \
  __attribute__((target_clones("arch=x86-64-v4", "arch=x86-64-v3", "default")))
#define BLAST_INLINE inline __attribute__((always_inline))
#else
#define BLAST_VECTOR_CLONES
#define BLAST_INLINE inline
#endif

namespace {

// Slow-down of a block where one C_D holds for all of it from beginning to end; false elsewhere.
BLAST_INLINE bool common_slowdown(const ParticleBlock &block, const Medium &medium,
                                  const double *speed, double time, double *ratio)
{
  double low = INFINITY, high = 0.0;
  if (medium.law == blast::DragLaw::chow) {
#pragma omp simd reduction(min : low) reduction(max : high)
    for (int j = 0; j < block.count; j++) {
      const double reynolds = blast::reynolds_number(medium, block.radius[j], speed[j]);
      low = std::min(low, reynolds);
      high = std::max(high, reynolds);
    }
  }
  const double drag_coefficient = blast::common_drag_coefficient(medium, low, high);
  if (drag_coefficient < 0.0) return false;

  double smallest = 1.0;
#pragma omp simd reduction(min : smallest)
  for (int j = 0; j < block.count; j++) {
    ratio[j] = blast::quadratic_slowdown(medium, block.radius[j], block.inverse_mass[j],
                                         drag_coefficient, speed[j], time);
    smallest = std::min(smallest, ratio[j]);
  }
  return blast::common_drag_coefficient(medium, low * smallest, high) >= 0.0;
}

// Drag over a time; returns its work.
BLAST_INLINE double slow_down(ParticleBlock &block, const Medium &medium, double time)
{
  if (medium.law == blast::DragLaw::none) return 0.0;
  double speed[ParticleBlock::CAPACITY], ratio[ParticleBlock::CAPACITY], work = 0.0;

#pragma omp simd
  for (int j = 0; j < block.count; j++) speed[j] = norm(block.velocity(j) - medium.velocity);

  if (!common_slowdown(block, medium, speed, time, ratio))
    for (int j = 0; j < block.count; j++)
      ratio[j] =
          blast::drag_slowdown(medium, block.radius[j], block.inverse_mass[j], speed[j], time);

#pragma omp simd reduction(+ : work)
  for (int j = 0; j < block.count; j++) {
    const Vector3 before = block.velocity(j);
    const Vector3 after = slowed(medium, before, ratio[j]);
    block.set_velocity(j, after);
    work += 0.5 * block.mass[j] * (dot(after, after) - dot(before, before));
  }
  return work;
}

// Gyration with drift over a step; returns the work of the magnetic force, zero to rounding.
BLAST_INLINE double turn(ParticleBlock &block, const Vector3 &axis, double step)
{
  double work = 0.0;
#pragma omp simd reduction(+ : work)
  for (int j = 0; j < block.count; j++) {
    Vector3 position = block.position(j), velocity = block.velocity(j);
    const double before = dot(velocity, velocity);
    gyrate(block.gyration[j], axis, step, position, velocity);
    block.set_position(j, position);
    block.set_velocity(j, velocity);
    work += 0.5 * block.mass[j] * (dot(velocity, velocity) - before);
  }
  return work;
}

} // namespace

BLAST_VECTOR_CLONES
DriftWork LAMMPS_NS::drift(ParticleBlock &block, const Medium &medium, const Vector3 &axis,
                           double step)
{
  DriftWork work;
  work.drag = slow_down(block, medium, 0.5 * step);
  work.magnetic = turn(block, axis, step);
  work.drag += slow_down(block, medium, 0.5 * step);
  return work;
}
