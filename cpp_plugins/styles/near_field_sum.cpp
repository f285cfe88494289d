#include "near_field_sum.h"

#include "inverse_root.h"
#include "near_field_powers.h"
#include "vector_clones.h"

#include <algorithm>
#include <cmath>

using namespace LAMMPS_NS;
using blast::NearField;
using blast::Vector3;

void FieldSources::resize(size_t count)
{
  for (auto *column : {&x, &y, &z, &factor}) column->resize(count);
}

void FieldSources::set(size_t k, const double *position, double factor_k)
{
  x[k] = position[0];
  y[k] = position[1];
  z[k] = position[2];
  factor[k] = factor_k;
}

void FieldForces::clear(size_t count)
{
  for (auto *column : {&x, &y, &z}) column->assign(count, 0.0);
}

namespace {

// So many sources, with what they feel, stay in the nearest cache while all targets pass by.
constexpr int SOURCES_AT_ONCE = 256;

BLAST_INLINE void add(FieldForces &forces, int k, const Vector3 &force)
{
  forces.x[k] += force.x;
  forces.y[k] += force.y;
  forces.z[k] += force.z;
}

// TARGETS (one or two) consecutive targets among the sources of a range: adds the forces per factor
// to `on_targets`. With MUTUAL the targets are sources' fellows, and the sources feel the opposite.
// Each source, once loaded, serves both targets.
template <int TARGETS, bool MUTUAL, class Root, class Law>
BLAST_INLINE double sum_rows(const Law &law, const FieldSources &targets, int target,
                             const FieldSources &sources, Range range, FieldForces &on_targets,
                             FieldForces *on_sources)
{
  const double *__restrict x = sources.x.data(), *__restrict y = sources.y.data(),
                           *__restrict z = sources.z.data(),
                           *__restrict factor = sources.factor.data();
  double *__restrict fx = MUTUAL ? on_sources->x.data() : nullptr;
  double *__restrict fy = MUTUAL ? on_sources->y.data() : nullptr;
  double *__restrict fz = MUTUAL ? on_sources->z.data() : nullptr;
  const Root inverse_root{};
  const int other = target + TARGETS - 1;
  const Vector3 a = targets.place(target), b = targets.place(other);
  const double factor_a = targets.factor[target], factor_b = targets.factor[other];
  double ax = 0.0, ay = 0.0, az = 0.0, bx = 0.0, by = 0.0, bz = 0.0, nearest = INFINITY;
#pragma omp simd reduction(+ : ax, ay, az, bx, by, bz) reduction(min : nearest)
  for (int j = range.begin; j < range.end; j++) {
    const double dx = x[j] - a.x, dy = y[j] - a.y, dz = z[j] - a.z;
    const double square = dx * dx + dy * dy + dz * dz;
    nearest = square < nearest ? square : nearest;
    const double force = law(inverse_root(square));
    const double on_a = factor[j] * force;
    ax += on_a * dx;
    ay += on_a * dy;
    az += on_a * dz;
    double from_a = factor_a * force, rx = from_a * dx, ry = from_a * dy, rz = from_a * dz;
    if constexpr (TARGETS == 2) {
      const double ex = x[j] - b.x, ey = y[j] - b.y, ez = z[j] - b.z;
      const double square_b = ex * ex + ey * ey + ez * ez;
      nearest = square_b < nearest ? square_b : nearest;
      const double force_b = law(inverse_root(square_b));
      const double on_b = factor[j] * force_b, from_b = factor_b * force_b;
      bx += on_b * ex;
      by += on_b * ey;
      bz += on_b * ez;
      rx += from_b * ex;
      ry += from_b * ey;
      rz += from_b * ez;
    }
    if constexpr (MUTUAL) {
      fx[j] -= rx;
      fy[j] -= ry;
      fz[j] -= rz;
    }
  }
  add(on_targets, target, {ax, ay, az});
  if constexpr (TARGETS == 2) add(on_targets, other, {bx, by, bz});
  return nearest;
}

template <bool MUTUAL, class Root, class Law>
BLAST_INLINE double sum_targets(const Law &law, const FieldSources &targets, Range target_range,
                                const FieldSources &sources, Range source_range,
                                FieldForces &on_targets, FieldForces *on_sources)
{
  double nearest = INFINITY;
  for (int first = source_range.begin; first < source_range.end; first += SOURCES_AT_ONCE) {
    const Range range{first, std::min(source_range.end, first + SOURCES_AT_ONCE)};
    int i = target_range.begin;
    for (; i + 1 < target_range.end; i += 2)
      nearest = std::fmin(nearest, sum_rows<2, MUTUAL, Root>(law, targets, i, sources, range,
                                                             on_targets, on_sources));
    if (i < target_range.end)
      nearest = std::fmin(nearest, sum_rows<1, MUTUAL, Root>(law, targets, i, sources, range,
                                                             on_targets, on_sources));
  }
  return nearest;
}

template <class Root>
BLAST_INLINE double among(const NearField &field, const FieldSources &particles, Range range,
                          FieldForces &forces)
{
  return with_law_of(field, [&](const auto &law) __attribute__((always_inline)) {
    double nearest = INFINITY;
    for (int first = range.begin; first < range.end; first += SOURCES_AT_ONCE) {
      const int end = std::min(range.end, first + SOURCES_AT_ONCE);
      for (int i = first; i < end; i++)
        nearest = std::fmin(nearest, sum_rows<1, true, Root>(law, particles, i, particles,
                                                             {i + 1, end}, forces, &forces));
      nearest = std::fmin(nearest, sum_targets<true, Root>(law, particles, {first, end}, particles,
                                                           {end, range.end}, forces, &forces));
    }
    return nearest;
  });
}

template <bool MUTUAL, class Root>
BLAST_INLINE double from(const NearField &field, const FieldSources &targets, Range target_range,
                         const FieldSources &sources, Range source_range, FieldForces &on_targets,
                         FieldForces *on_sources)
{
  return with_law_of(field, [&](const auto &law) __attribute__((always_inline)) {
    return sum_targets<MUTUAL, Root>(law, targets, target_range, sources, source_range, on_targets,
                                     on_sources);
  });
}

BLAST_WIDE double among_wide(const NearField &field, const FieldSources &particles, Range range,
                             FieldForces &forces)
{
  return among<IteratedRoot>(field, particles, range, forces);
}

BLAST_NARROW_CLONES double among_narrow(const NearField &field, const FieldSources &particles,
                                        Range range, FieldForces &forces)
{
  return among<DividedRoot>(field, particles, range, forces);
}

BLAST_WIDE double between_wide(const NearField &field, const FieldSources &particles, Range a,
                               Range b, FieldForces &forces)
{
  return from<true, IteratedRoot>(field, particles, a, particles, b, forces, &forces);
}

BLAST_NARROW_CLONES double between_narrow(const NearField &field, const FieldSources &particles,
                                          Range a, Range b, FieldForces &forces)
{
  return from<true, DividedRoot>(field, particles, a, particles, b, forces, &forces);
}

BLAST_WIDE double from_wide(const NearField &field, const FieldSources &targets, Range target_range,
                            const FieldSources &sources, Range source_range,
                            FieldForces &on_targets)
{
  return from<false, IteratedRoot>(field, targets, target_range, sources, source_range, on_targets,
                                   nullptr);
}

BLAST_NARROW_CLONES double from_narrow(const NearField &field, const FieldSources &targets,
                                       Range target_range, const FieldSources &sources,
                                       Range source_range, FieldForces &on_targets)
{
  return from<false, DividedRoot>(field, targets, target_range, sources, source_range, on_targets,
                                  nullptr);
}

template <class Potential>
BLAST_INLINE double potential_in(const Potential &potential, const Vector3 &target,
                                 const FieldSources &sources, Range range)
{
  const double *__restrict x = sources.x.data(), *__restrict y = sources.y.data(),
                           *__restrict z = sources.z.data(),
                           *__restrict factor = sources.factor.data();
  const DividedRoot inverse_root{};
  double sum = 0.0;
#pragma omp simd reduction(+ : sum)
  for (int j = range.begin; j < range.end; j++) {
    const double dx = x[j] - target.x, dy = y[j] - target.y, dz = z[j] - target.z;
    sum += factor[j] * potential(inverse_root(dx * dx + dy * dy + dz * dz));
  }
  return sum;
}

} // namespace

namespace LAMMPS_NS {

double sum_among(const NearField &field, const FieldSources &particles, Range range,
                 FieldForces &forces)
{
  return has_wide_vectors() ? among_wide(field, particles, range, forces)
                            : among_narrow(field, particles, range, forces);
}

double sum_between(const NearField &field, const FieldSources &particles, Range a, Range b,
                   FieldForces &forces)
{
  return has_wide_vectors() ? between_wide(field, particles, a, b, forces)
                            : between_narrow(field, particles, a, b, forces);
}

double sum_from(const NearField &field, const FieldSources &targets, Range target_range,
                const FieldSources &sources, Range source_range, FieldForces &on_targets)
{
  return has_wide_vectors()
             ? from_wide(field, targets, target_range, sources, source_range, on_targets)
             : from_narrow(field, targets, target_range, sources, source_range, on_targets);
}

BLAST_VECTOR_CLONES void sum_potential_from(const NearField &field, const FieldSources &targets,
                                            Range target_range, const FieldSources &sources,
                                            Range source_range, double *potential)
{
  const bool among_themselves = &targets == &sources;
  with_potential_of(field, [&](const auto &law) __attribute__((always_inline)) {
    for (int i = target_range.begin; i < target_range.end; i++) {
      const bool is_source = among_themselves && i >= source_range.begin && i < source_range.end;
      const int end = is_source ? i : source_range.end;
      const Vector3 target = targets.place(i);
      potential[i] += potential_in(law, target, sources, {source_range.begin, end});
      if (is_source) potential[i] += potential_in(law, target, sources, {i + 1, source_range.end});
    }
  });
}

} // namespace LAMMPS_NS
