// Two spheres in contact: the lens that they share (eqs. 7.6, B.4-B.6), the elastic force
// (eq. 7.5), its softening by heat (eqs. 7.18-7.20) and its dissipation (eq. 7.10).

#ifndef BLAST_LAWS_CONTACT_H
#define BLAST_LAWS_CONTACT_H

#include "power.h"
#include "sphere.h"
#include "vector3.h"

#include <algorithm>
#include <cmath>

namespace blast {

// |E_ij| of eq. 7.6 for spheres that touch or overlap.
inline double contact_strain(double distance, double radius_i, double radius_j)
{
  const double reach = radius_i + radius_j;
  return (reach - distance) / reach;
}

// Tells whether the smaller sphere lies so deep in the larger one that their surfaces do not meet:
// L_i of eq. B.6 is then outside [-R_i, R_i].
inline bool is_swallowed(double distance, double radius_i, double radius_j)
{
  return distance < std::fabs(radius_i - radius_j);
}

// L_i, eq. B.6: from the centre of i to the plane of the lens; for j it is distance - L_i.
inline double lens_arm(double distance, double radius_i, double radius_j)
{
  return 0.5 * (distance - (radius_j - radius_i) * (radius_j + radius_i) / distance);
}

// A^c = pi (R_i^2 - L_i^2), eq. B.5, as a product in which nothing cancels.
inline double lens_area(double distance, double radius_i, double radius_j)
{
  if (is_swallowed(distance, radius_i, radius_j)) {
    const double smaller = std::min(radius_i, radius_j);
    return pi * smaller * smaller;
  }
  const double reach = radius_i + radius_j, difference = radius_i - radius_j;
  return 0.25 * pi * (reach - distance) * (reach + distance) * (distance - difference) *
         (distance + difference) / (distance * distance);
}

// K_p of one particle, eq. 7.18.
inline double softened_stiffness(double stiffness, double temperature, double reference,
                                 double sensitivity, double floor)
{
  return std::max(stiffness * std::exp(-sensitivity * (temperature / reference - 1.0)), floor);
}

// K_p of a pair, eq. 7.20.
inline double pair_stiffness(double stiffness_i, double stiffness_j)
{
  return 0.5 * (stiffness_i + stiffness_j);
}

// Magnitude of eq. 7.5, which pushes the particles apart.
inline double normal_force(double stiffness, const Power &exponent, double strain, double area)
{
  return stiffness * exponent(strain) * area;
}

// Eq. 7.10 along n_ij, on i: `closing` is (v_j - v_i) . n_ij. It may pull.
inline double damping_force(double damping, double closing, double area)
{
  return damping * closing * area;
}

// Slip at the contact point (eqs. 7.9, 7.13, 7.14): the part across n_ij of v^c_j - v^c_i, with
// v^c = v + omega x r. Without rotation, arms are zero.
inline Vector3 slip_velocity(const Vector3 &relative_velocity, const Vector3 &spin_i,
                             const Vector3 &spin_j, double arm_i, double arm_j,
                             const Vector3 &normal)
{
  const Vector3 relative = relative_velocity - cross(arm_j * spin_j + arm_i * spin_i, normal);
  return relative - dot(relative, normal) * normal;
}

} // namespace blast

#endif
