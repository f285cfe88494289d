// Two ways to 1/sqrt(square) in vector loops. The second has neither root nor division, which
// processors with wide vectors do much more slowly than products.

#ifndef BLAST_STYLES_INVERSE_ROOT_H
#define BLAST_STYLES_INVERSE_ROOT_H

#include "vector_clones.h"

#include <cmath>
#include <cstdint>
#include <cstring>

namespace LAMMPS_NS {

struct DividedRoot {
  BLAST_INLINE double operator()(double square) const { return 1.0 / std::sqrt(square); }
};

// From half the exponent of the square, good to 4 %, by the series of (1 - residual)^(-1/2): to
// 7e-6 with its terms up to the third power, then to rounding with two. For zero it is large and
// finite.
struct IteratedRoot {
  BLAST_INLINE double operator()(double square) const
  {
    constexpr std::int64_t half_of_all_exponents = 0x5FE6EB50C7B537A9;
    std::int64_t bits;
    static_assert(sizeof bits == sizeof square);
    std::memcpy(&bits, &square, sizeof bits);
    bits = half_of_all_exponents - (bits >> 1);
    double root;
    std::memcpy(&root, &bits, sizeof root);

    double residual = 1.0 - square * root * root;
    root *= 1.0 + residual * (1.0 / 2.0 + residual * (3.0 / 8.0 + residual * (5.0 / 16.0)));
    residual = 1.0 - square * root * root;
    return root + root * (residual * (1.0 / 2.0 + residual * (3.0 / 8.0)));
  }
};

} // namespace LAMMPS_NS

#endif
