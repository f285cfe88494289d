// The phi-trapezoid of section 8: new velocities and positions from the forces at both ends of a
// step, eqs. 8.1 to 8.3, and the part of it that has a closed form in a magnetic field and a
// medium.

#ifndef BLAST_LAWS_TRAPEZOID_H
#define BLAST_LAWS_TRAPEZOID_H

#include "vector3.h"

namespace blast {

// How a value over a step is made of those at its ends: phi of the new one, 1 - phi of the old.
struct Trapezoid {
  double phi = 0.5;

  Vector3 mean(const Vector3 &new_value, const Vector3 &old_value) const
  {
    return phi * new_value + (1.0 - phi) * old_value;
  }
};

// Solves v = start + theta v x axis - gamma (v - wind): the velocity whose own magnetic force and
// drag have brought it about. theta is the angle of gyration and gamma the part of the relative
// velocity that drag takes, both in phi times the step.
inline Vector3 turned_and_slowed(const Vector3 &start, double theta, const Vector3 &axis,
                                 double gamma, const Vector3 &wind)
{
  const double whole = 1.0 + gamma, square = whole * whole + theta * theta;
  const Vector3 driven = start + gamma * wind;
  return (1.0 / square) * (whole * driven + theta * cross(driven, axis) +
                           (theta * theta / whole * dot(driven, axis)) * axis);
}

} // namespace blast

#endif
