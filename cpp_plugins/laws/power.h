// A power with a fixed real exponent. Whole and half exponents, which most laws have, are products
// and a square root; only others pay for pow.

#ifndef BLAST_LAWS_POWER_H
#define BLAST_LAWS_POWER_H

#include <cmath>

namespace blast {

class Power {
public:
  Power() = default;
  explicit Power(double exponent_) : exponent(exponent_)
  {
    const double doubled = 2.0 * exponent;
    if (doubled >= 0.0 && doubled <= largest_doubled && doubled == std::floor(doubled))
      twice = static_cast<int>(doubled);
    else
      twice = -1;
  }

  double operator()(double base) const
  {
    if (twice == 2) return base;
    if (twice == 4) return base * base;
    if (twice < 0) return std::pow(base, exponent);
    double result = (twice & 1) ? std::sqrt(base) : 1.0;
    for (int n = twice >> 1; n > 0; n >>= 1) {
      if (n & 1) result *= base;
      base *= base;
    }
    return result;
  }

  double exponent = 0.0;
  int twice = 0; // the exponent times two where that is a small whole number, else -1

private:
  static constexpr double largest_doubled = 64.0;
};

} // namespace blast

#endif
