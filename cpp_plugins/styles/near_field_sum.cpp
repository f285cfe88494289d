#include "near_field_sum.h"

#include "vector3.h"
#include "vector_clones.h"

#include <algorithm>
#include <cmath>

using namespace LAMMPS_NS;
using blast::NearField;

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

// A whole exponent known to the compiler.
template <int EXPONENT> struct WholePower {
  BLAST_INLINE double operator()(double base) const
  {
    if constexpr (EXPONENT == 0)
      return 1.0;
    else if constexpr (EXPONENT % 2 == 0)
      return WholePower<EXPONENT / 2>()(base * base);
    else
      return base * WholePower<EXPONENT / 2>()(base * base);
  }
};

// A whole exponent up to 15 or, with HALVES, a half one, known at run time: a product over the bits
// of the exponent, each factor either the power of two of the base or one.
template <bool HALVES> struct BinaryPower {
  double as_is[5], one[5];
  explicit BinaryPower(int twice)
  {
    for (int bit = 0; bit < 5; bit++) {
      as_is[bit] = (twice >> bit) & 1 ? 1.0 : 0.0;
      one[bit] = 1.0 - as_is[bit];
    }
  }
  BLAST_INLINE double operator()(double base) const
  {
    double power = 1.0;
    if (HALVES) power = as_is[0] * std::sqrt(base) + one[0];
    double square = base;
    for (int bit = 1; bit < 5; bit++) {
      power *= as_is[bit] * square + one[bit];
      square *= square;
    }
    return power;
  }
};

// Eq. 7.23 over the distance, so that it can be multiplied with the offset.
template <class AttractionPower, class RepulsionPower> struct FieldByPowers {
  double attraction, repulsion;
  AttractionPower attraction_power;
  RepulsionPower repulsion_power;
  BLAST_INLINE double operator()(double inverse) const
  {
    return inverse * blast::near_field_balance(attraction, attraction_power, repulsion,
                                               repulsion_power, inverse);
  }
};

// Calls `sum` with the cheapest law that has the exponents of the field.
template <class Sum> BLAST_INLINE double with_law_of(const NearField &field, const Sum &sum)
{
  const double a = field.attraction.strength, r = field.repulsion.strength;
  const auto by = [a, r](const auto &attraction_power, const auto &repulsion_power) {
    return FieldByPowers<std::decay_t<decltype(attraction_power)>,
                         std::decay_t<decltype(repulsion_power)>>{a, r, attraction_power,
                                                                  repulsion_power};
  };
  // An exponent does not matter where the strength is zero.
  int twice_a = field.attraction.power.twice, twice_r = field.repulsion.power.twice;
  if (a == 0.0) twice_a = twice_r == 4 ? 2 : twice_r;
  if (r == 0.0) twice_r = twice_a == 2 ? 4 : twice_a;

  if (twice_a == 2 && twice_r == 4) return sum(by(WholePower<1>(), WholePower<2>()));
  if (twice_a == 4 && twice_r == 2) return sum(by(WholePower<2>(), WholePower<1>()));
  if (twice_a == 4 && twice_r == 4) return sum(by(WholePower<2>(), WholePower<2>()));
  if (twice_a == 2 && twice_r == 6) return sum(by(WholePower<1>(), WholePower<3>()));
  if (twice_a == 4 && twice_r == 6) return sum(by(WholePower<2>(), WholePower<3>()));
  constexpr int largest = 31;
  if (twice_a >= 0 && twice_r >= 0 && std::max(twice_a, twice_r) <= largest) {
    if (twice_a % 2 == 0 && twice_r % 2 == 0)
      return sum(by(BinaryPower<false>(twice_a), BinaryPower<false>(twice_r)));
    return sum(by(BinaryPower<true>(twice_a), BinaryPower<true>(twice_r)));
  }
  return sum(by(field.attraction.power, field.repulsion.power));
}

// One target among the sources of a range: adds the force per factor of the target to `on_target`.
// With MUTUAL the sources are targets as well, and feel the opposite.
template <bool MUTUAL, class Law>
BLAST_INLINE double sum_row(const Law law, const blast::Vector3 target, double target_factor,
                            const FieldSources &sources, Range range, blast::Vector3 &on_target,
                            FieldForces *on_sources)
{
  const double *__restrict x = sources.x.data(), *__restrict y = sources.y.data(),
                           *__restrict z = sources.z.data(),
                           *__restrict factor = sources.factor.data();
  double *__restrict fx = MUTUAL ? on_sources->x.data() : nullptr;
  double *__restrict fy = MUTUAL ? on_sources->y.data() : nullptr;
  double *__restrict fz = MUTUAL ? on_sources->z.data() : nullptr;
  double ax = 0.0, ay = 0.0, az = 0.0, nearest = INFINITY;
#pragma omp simd reduction(+ : ax, ay, az) reduction(min : nearest)
  for (int j = range.begin; j < range.end; j++) {
    const double dx = x[j] - target.x, dy = y[j] - target.y, dz = z[j] - target.z;
    const double square = dx * dx + dy * dy + dz * dz;
    nearest = square < nearest ? square : nearest;
    const double force = law(1.0 / std::sqrt(square));
    const double on_row = factor[j] * force;
    ax += on_row * dx;
    ay += on_row * dy;
    az += on_row * dz;
    if constexpr (MUTUAL) {
      const double on_source = target_factor * force;
      fx[j] -= on_source * dx;
      fy[j] -= on_source * dy;
      fz[j] -= on_source * dz;
    }
  }
  on_target += {ax, ay, az};
  return nearest;
}

BLAST_INLINE blast::Vector3 place(const FieldSources &sources, int k)
{
  return {sources.x[k], sources.y[k], sources.z[k]};
}

BLAST_INLINE void add(FieldForces &forces, int k, const blast::Vector3 &force)
{
  forces.x[k] += force.x;
  forces.y[k] += force.y;
  forces.z[k] += force.z;
}

} // namespace

namespace LAMMPS_NS {

BLAST_VECTOR_CLONES double sum_among(const NearField &field, const FieldSources &particles,
                                     Range range, FieldForces &forces)
{
  return with_law_of(field, [&](const auto &law) __attribute__((always_inline)) {
    double nearest = INFINITY;
    for (int i = range.begin; i < range.end; i++) {
      blast::Vector3 force;
      nearest = std::fmin(nearest, sum_row<true>(law, place(particles, i), particles.factor[i],
                                                 particles, {i + 1, range.end}, force, &forces));
      add(forces, i, force);
    }
    return nearest;
  });
}

BLAST_VECTOR_CLONES double sum_from(const NearField &field, const FieldSources &targets,
                                    Range target_range, const FieldSources &sources,
                                    Range source_range, FieldForces &on_targets)
{
  return with_law_of(field, [&](const auto &law) __attribute__((always_inline)) {
    double nearest = INFINITY;
    for (int i = target_range.begin; i < target_range.end; i++) {
      blast::Vector3 force;
      nearest = std::fmin(nearest, sum_row<false>(law, place(targets, i), 0.0, sources,
                                                  source_range, force, nullptr));
      add(on_targets, i, force);
    }
    return nearest;
  });
}

} // namespace LAMMPS_NS
