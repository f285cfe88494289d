// Eq. 7.23 for loops over many pairs: the powers of its two terms in forms that the compiler can
// put into vectors, the cheapest that has the exponents.

#ifndef BLAST_STYLES_NEAR_FIELD_POWERS_H
#define BLAST_STYLES_NEAR_FIELD_POWERS_H

#include "near_field.h"
#include "vector_clones.h"

#include <algorithm>
#include <cmath>
#include <type_traits>

#ifdef BLAST_VECTOR_MATH_WORKS
// The C library has these for whole vectors too.
extern "C" {
#pragma omp declare simd notinbranch
double exp(double) noexcept;
#pragma omp declare simd notinbranch
double log(double) noexcept;
}
#endif

namespace LAMMPS_NS {

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
// of twice the exponent, without branches.
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

// Any exponent. Two of the same base share its logarithm.
struct RealPower {
  double exponent;
  BLAST_INLINE double operator()(double base) const { return exp(exponent * log(base)); }
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
template <class Sum> BLAST_INLINE double with_law_of(const blast::NearField &field, const Sum &sum)
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
  return sum(
      by(RealPower{field.attraction.power.exponent}, RealPower{field.repulsion.power.exponent}));
}

// Potential of eq. 7.23 without a cutoff, of 1/d.
template <bool LOGARITHM, class AttractionPower, class RepulsionPower> struct PotentialByPowers {
  double per_logarithm; // of d
  double attraction, repulsion;
  AttractionPower attraction_power;
  RepulsionPower repulsion_power;
  BLAST_INLINE double operator()(double inverse) const
  {
    const double powers = blast::near_field_balance(attraction, attraction_power, repulsion,
                                                    repulsion_power, inverse);
    return LOGARITHM ? powers - per_logarithm * log(inverse) : powers;
  }
};

// Calls `use` with the cheapest power of 1/d that is d^growth.
template <class Use> BLAST_INLINE void with_power_of(double growth, const Use &use)
{
  if (growth == 0.0)
    use(WholePower<0>());
  else if (growth == -1.0)
    use(WholePower<1>());
  else
    use(RealPower{-growth});
}

// Calls `use` with the cheapest potential of a field.
template <class Use>
BLAST_INLINE void with_potential_of(const blast::NearField &field, const Use &use)
{
  const blast::BarePotential attraction(field.attraction), repulsion(field.repulsion);
  const double per_logarithm = attraction.per_logarithm - repulsion.per_logarithm;
  with_power_of(
      attraction.growth, [&](const auto &attraction_power) __attribute__((always_inline)) {
        with_power_of(
            repulsion.growth, [&](const auto &repulsion_power) __attribute__((always_inline)) {
              using A = std::decay_t<decltype(attraction_power)>;
              using R = std::decay_t<decltype(repulsion_power)>;
              const double a = attraction.per_power, r = repulsion.per_power;
              if (per_logarithm != 0.0)
                use(PotentialByPowers<true, A, R>{per_logarithm, a, r, attraction_power,
                                                  repulsion_power});
              else
                use(PotentialByPowers<false, A, R>{0.0, a, r, attraction_power, repulsion_power});
            });
      });
}

} // namespace LAMMPS_NS

#endif
