// The magnetic part of the Lorentz force (eqs. 2.1, 7.22) and the exact motion that it causes in a
// uniform field (eqs. 2.5, 2.8, for any direction of the field).

#ifndef BLAST_LAWS_LORENTZ_H
#define BLAST_LAWS_LORENTZ_H

#include "vector3.h"

#include <cmath>

namespace blast {

inline Vector3 magnetic_force(double charge, const Vector3 &velocity, const Vector3 &magnetic)
{
  return charge * cross(velocity, magnetic);
}

// omega = q |B| / m, with the sign of the charge
inline double cyclotron_frequency(double charge, double mass, double magnetic_strength)
{
  return charge * magnetic_strength / mass;
}

// One step of gyration by the angle theta = omega dt, ready to be applied to many particles.
// Half-angle forms keep |v| to rounding over millions of steps: the increment of v, not v itself,
// carries the rounding of sine and cosine.
struct Gyration {
  double sine = 0.0, one_minus_cosine = 0.0;
  double mean_cosine = 1.0; // sin(theta)/theta
  double mean_sine = 0.0;   // (1 - cos(theta))/theta

  Gyration() = default;
  explicit Gyration(double angle)
  {
    if (angle == 0.0) return;
    const double half_sine = std::sin(0.5 * angle), half_cosine = std::cos(0.5 * angle);
    sine = 2.0 * half_sine * half_cosine;
    one_minus_cosine = 2.0 * half_sine * half_sine;
    mean_cosine = sine / angle;
    mean_sine = one_minus_cosine / angle;
  }

  // The gyration of the opposite charge.
  Gyration reversed() const
  {
    Gyration opposite = *this;
    opposite.sine = -sine;
    opposite.mean_sine = -mean_sine;
    return opposite;
  }
};

// Drift and gyration about the unit vector `axis` of B for one step: dv/dt = omega v x axis.
inline void gyrate(const Gyration &gyration, const Vector3 &axis, double time, Vector3 &position,
                   Vector3 &velocity)
{
  const Vector3 sideways = cross(velocity, axis);
  const Vector3 across = velocity - dot(velocity, axis) * axis;
  position +=
      time * (velocity + (gyration.mean_cosine - 1.0) * across + gyration.mean_sine * sideways);
  velocity += gyration.sine * sideways - gyration.one_minus_cosine * across;
}

} // namespace blast

#endif
