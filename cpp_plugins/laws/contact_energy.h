// Work done against a force |E|^p A^c, of unit stiffness, from touch down to an overlap: the
// potential of the contact (eq. 7.5) and, with the sign reversed, of the bond (eq. 7.16).

#ifndef BLAST_LAWS_CONTACT_ENERGY_H
#define BLAST_LAWS_CONTACT_ENERGY_H

#include "contact.h"

namespace blast {

// From touch to a strain E that is not beyond 1/2 and not swallowed. With s = R_i + R_j and
// D = R_i - R_j the integral of E^p A s dE is, term by term,
// pi/4 s^3 E^(p+2) [2/(p+2) - E/(p+3) - (D/s)^2 sum_k (k+2)/(k+2+p) E^k].
inline double lens_work_series(double exponent, double strain, double reach, double difference)
{
  double sum = 0.0;
  const double unequal = difference * difference / (reach * reach);
  double power = unequal;
  for (int k = 2; power > 1e-17; k++) {
    sum += k / (k + exponent) * power;
    power *= strain;
  }
  return 0.25 * pi * reach * reach * reach * std::pow(strain, exponent + 2.0) *
         (2.0 / (exponent + 2.0) - strain / (exponent + 3.0) - sum);
}

// From one distance down to another by Gauss and Legendre, in pieces over which the distance falls
// by no more than a quarter.
inline double lens_work_quadrature(double exponent, double from, double to, double radius_i,
                                   double radius_j)
{
  static constexpr double node[] = {0.1834346424956498, 0.5255324099163290, 0.7966664774136267,
                                    0.9602898564975363};
  static constexpr double weight[] = {0.3626837833783620, 0.3137066458778873, 0.2223810344533745,
                                      0.1012285362903763};
  const auto force = [=](double distance) {
    return std::pow(contact_strain(distance, radius_i, radius_j), exponent) *
           lens_area(distance, radius_i, radius_j);
  };
  double work = 0.0;
  while (from > to) {
    const double end = std::max(to, 0.75 * from);
    const double middle = 0.5 * (from + end), half = 0.5 * (from - end);
    for (int n = 0; n < 4; n++)
      work += half * weight[n] * (force(middle - half * node[n]) + force(middle + half * node[n]));
    from = end;
  }
  return work;
}

// Integral of E^p A^c over the distance, from `distance` to touch, per unit stiffness.
inline double lens_work(double exponent, double distance, double radius_i, double radius_j)
{
  const double reach = radius_i + radius_j, difference = std::fabs(radius_i - radius_j);
  // Beyond these the lens is a whole disk, and the series converges too slowly.
  const double rim = std::max(distance, difference), half_way = 0.5 * reach;
  const double series_end = std::max(rim, half_way);
  const double series_strain = contact_strain(series_end, radius_i, radius_j);
  double work = lens_work_series(exponent, series_strain, reach, difference);
  if (rim < half_way) work += lens_work_quadrature(exponent, half_way, rim, radius_i, radius_j);
  if (distance < difference) {
    const double strain = contact_strain(distance, radius_i, radius_j);
    const double at_rim = contact_strain(difference, radius_i, radius_j);
    const double smaller = std::min(radius_i, radius_j);
    work += pi * smaller * smaller * reach *
            (std::pow(strain, exponent + 1.0) - std::pow(at_rim, exponent + 1.0)) /
            (exponent + 1.0);
  }
  return work;
}

} // namespace blast

#endif
