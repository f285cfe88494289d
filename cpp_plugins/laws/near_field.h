// The near field between two particles, eq. 7.23: attraction alpha_1 d^-beta_1 less repulsion
// alpha_2 d^-beta_2, whole or cut off.

#ifndef BLAST_LAWS_NEAR_FIELD_H
#define BLAST_LAWS_NEAR_FIELD_H

#include "power.h"
#include "sphere.h"

#include <cmath>

namespace blast {

// The decompositions of alpha below eq. 7.23.
enum class Scaling { mass, area, volume, charge };

// The factor of one particle in alpha_ij = alpha * factor_i * factor_j; `sign` is c = +1 or -1. For
// charges c is the sign of q itself.
inline double near_field_factor(Scaling scaling, double mass, double radius, double charge,
                                double sign)
{
  switch (scaling) {
  case Scaling::mass:
    return mass * sign;
  case Scaling::area:
    return sphere_surface(radius) * sign;
  case Scaling::volume:
    return sphere_volume(radius) * sign;
  case Scaling::charge:
    break;
  }
  return charge;
}

// One of the two terms: strength * d^-exponent, per unit factors.
struct PowerLaw {
  double strength = 0.0; // alpha
  Power power;           // of 1/d, beta

  PowerLaw() = default;
  // The exponent of nothing is of no account, and must not make it infinite.
  PowerLaw(double strength_, double exponent)
      : strength(strength_), power(strength == 0.0 ? 0.0 : exponent)
  {
  }
};

// Integral of one term over d without a cutoff, with the constant that makes it a pure power, or a
// logarithm of d over one metre for beta = 1.
struct BarePotential {
  double per_logarithm = 0.0, per_power = 0.0, growth = 0.0; // of d

  explicit BarePotential(const PowerLaw &law)
  {
    const double rest = 1.0 - law.power.exponent;
    if (law.strength == 0.0) return;
    if (rest == 0.0) {
      per_logarithm = law.strength;
    } else {
      per_power = law.strength / rest;
      growth = rest;
    }
  }

  // Of the logarithm of d; power(growth) is d^growth.
  template <class PowerOfDistance>
  double operator()(double logarithm, const PowerOfDistance &power) const
  {
    return per_logarithm * logarithm + per_power * power(growth);
  }
};

struct NearField {
  PowerLaw attraction, repulsion;
  double cutoff = 0.0; // zero: none
  double switch_width = 0.0;

  bool is_cut() const { return cutoff > 0.0; }
};

// A step from 1 at `cutoff - switch_width` down to 0 at `cutoff`, with two continuous derivatives.
inline double switching(const NearField &field, double distance)
{
  const double left = (field.cutoff - distance) / field.switch_width, part = 1.0 - left;
  if (part <= 0.0) return 1.0;
  return left * left * left * (1.0 + part * (3.0 + 6.0 * part));
}

// Attraction less repulsion of eq. 7.23 for unit factors, with neither cutoff nor switch; the two
// powers are of any kind that knows its exponent.
template <class AttractionPower, class RepulsionPower>
inline double near_field_balance(double attraction, const AttractionPower &attraction_power,
                                 double repulsion, const RepulsionPower &repulsion_power,
                                 double inverse_distance)
{
  return attraction * attraction_power(inverse_distance) -
         repulsion * repulsion_power(inverse_distance);
}

inline double bare_near_field_force(const NearField &field, double inverse_distance)
{
  return near_field_balance(field.attraction.strength, field.attraction.power,
                            field.repulsion.strength, field.repulsion.power, inverse_distance);
}

// Force along n_ij on i, for unit factors and a distance not beyond the cutoff.
inline double near_field_force(const NearField &field, double distance, double inverse_distance)
{
  const double force = bare_near_field_force(field, inverse_distance);
  return field.switch_width > 0.0 ? switching(field, distance) * force : force;
}

inline double near_field_force(const NearField &field, double distance)
{
  return near_field_force(field, distance, 1.0 / distance);
}

// Integral of strength * d^-beta over d: from the cutoff, where it is zero, or without one.
inline double power_law_energy(const PowerLaw &law, double distance, double cutoff)
{
  if (law.strength == 0.0) return 0.0;
  const double rest = 1.0 - law.power.exponent;
  if (cutoff > 0.0) {
    const double logarithm = std::log(distance / cutoff), growth = rest * logarithm;
    if (std::fabs(growth) > 1.0)
      return law.strength * (std::pow(distance, rest) - std::pow(cutoff, rest)) / rest;
    // Near beta = 1 and near the cutoff the difference would cancel.
    const double ratio = growth == 0.0 ? 1.0 : std::expm1(growth) / growth;
    return law.strength * std::pow(cutoff, rest) * logarithm * ratio;
  }
  const auto power = [distance](double growth) { return std::pow(distance, growth); };
  return BarePotential(law)(std::log(distance), power);
}

inline double bare_near_field_energy(const NearField &field, double distance, double cutoff)
{
  return power_law_energy(field.attraction, distance, cutoff) -
         power_law_energy(field.repulsion, distance, cutoff);
}

// Work of the switched force from a distance within the switch to the cutoff, by Gauss and
// Legendre, with its sign reversed.
inline double switched_energy(const NearField &field, double distance)
{
  static constexpr double node[] = {0.1488743389816312, 0.4333953941292472, 0.6794095682990244,
                                    0.8650633666889845, 0.9739065285171717};
  static constexpr double weight[] = {0.2955242247147529, 0.2692667193099963, 0.2190863625159820,
                                      0.1494513491505806, 0.0666713443086881};
  double energy = 0.0;
  // The force may change by much across a wide switch: pieces reach no farther than a quarter on.
  while (distance < field.cutoff) {
    const double end = std::fmin(field.cutoff, 1.25 * distance);
    const double middle = 0.5 * (distance + end), half = 0.5 * (end - distance);
    for (int n = 0; n < 5; n++)
      energy -= half * weight[n] *
                (near_field_force(field, middle - half * node[n]) +
                 near_field_force(field, middle + half * node[n]));
    distance = end;
  }
  return energy;
}

// The operator (1/d) d/dd turns d^(-beta - 2 m + 1), the m-th such derivative of the potential of a
// term for m > 0, into d^-2 times itself times this.
inline double radial_derivative_factor(double exponent, int derivative)
{
  return -(exponent + 2.0 * derivative - 1.0);
}

// Potential for unit factors: the force along n_ij is its derivative. Zero at the cutoff.
inline double near_field_energy(const NearField &field, double distance)
{
  if (field.switch_width <= 0.0) return bare_near_field_energy(field, distance, field.cutoff);
  const double begin = field.cutoff - field.switch_width;
  if (distance >= begin) return switched_energy(field, distance);
  return switched_energy(field, begin) + bare_near_field_energy(field, distance, begin);
}

} // namespace blast

#endif
