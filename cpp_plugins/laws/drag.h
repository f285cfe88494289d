// Drag of a sphere in a medium: constant C_D, Chow's fit and Stokes, as forces
// (eqs. 3.6, 4.2, 4.13) and as exact flows of the velocity under drag alone (eqs. 4.10, A.5 and
// their like).

#ifndef BLAST_LAWS_DRAG_H
#define BLAST_LAWS_DRAG_H

#include "vector3.h"

#include <cmath>

namespace blast {

constexpr double pi = 3.14159265358979323846;

enum class DragLaw { none, constant, chow, stokes };

struct Medium {
  DragLaw law = DragLaw::none;
  double drag_coefficient = 0.0; // C_D, read by DragLaw::constant
  double density = 0.0;          // rho_a, kg/m3
  double viscosity = 0.0;        // mu_f, Pa s
  Vector3 velocity;              // v_f, m/s
};

// One branch of Chow's fit: C_D = coefficient * Re^exponent for Re above `reynolds_above`.
struct ChowBranch {
  double reynolds_above, coefficient, exponent;
};

// Eq. 4.2. The fit jumps at Re = 3e5; the jump is part of it.
constexpr int chow_branch_count = 5;
constexpr ChowBranch chow_branches[chow_branch_count] = {{0.0, 24.0, -1.0},
                                                         {1.0, 24.0, -0.646},
                                                         {400.0, 0.5, 0.0},
                                                         {3.0e5, 0.000366, 0.4275},
                                                         {2.0e6, 0.18, 0.0}};

inline int chow_branch(double reynolds)
{
  int branch = chow_branch_count - 1;
  while (branch > 0 && reynolds <= chow_branches[branch].reynolds_above) --branch;
  return branch;
}

inline double chow_drag_coefficient(double reynolds)
{
  const ChowBranch &branch = chow_branches[chow_branch(reynolds)];
  if (branch.exponent == 0.0) return branch.coefficient;
  return branch.coefficient * std::pow(reynolds, branch.exponent);
}

// Re = 2 R rho_a |v_f - v| / mu_f
inline double reynolds_number(const Medium &medium, double radius, double relative_speed)
{
  return 2.0 * radius * relative_speed * (medium.density / medium.viscosity);
}

// c of F = c (v_f - v), eq. 4.13
inline double stokes_friction(const Medium &medium, double radius)
{
  return 6.0 * pi * medium.viscosity * radius;
}

// F / C_D / |v_f - v|^2 of eq. 3.6, with A = pi R^2 (eq. 7.21)
inline double dynamic_pressure_area(const Medium &medium, double radius)
{
  return 0.5 * medium.density * pi * radius * radius;
}

// Force of the medium on a sphere: eq. 3.6 with C_D constant or from eq. 4.2, or eq. 4.13.
inline Vector3 drag_force(const Medium &medium, double radius, const Vector3 &velocity)
{
  const Vector3 relative = medium.velocity - velocity;
  const double speed = norm(relative);
  if (speed == 0.0) return {};
  switch (medium.law) {
  case DragLaw::constant:
    return dynamic_pressure_area(medium, radius) * medium.drag_coefficient * speed * relative;
  case DragLaw::chow:
    return dynamic_pressure_area(medium, radius) *
           chow_drag_coefficient(reynolds_number(medium, radius, speed)) * speed * relative;
  case DragLaw::stokes:
    return stokes_friction(medium, radius) * relative;
  case DragLaw::none:
    break;
  }
  return {};
}

// u(time)/u(0) for du/dt = -rate u^power, power >= 1, exact.
inline double slowdown(double speed, double rate, double power, double time)
{
  if (power == 2.0) return 1.0 / (1.0 + rate * speed * time);
  if (power == 1.0) return std::exp(-rate * time);
  const double growth = (power - 1.0) * rate * std::pow(speed, power - 1.0) * time;
  return std::pow(1.0 + growth, -1.0 / (power - 1.0));
}

// Time in which du/dt = -rate u^power brings the speed down to `lower`.
inline double time_to_slow(double speed, double lower, double rate, double power)
{
  if (power == 1.0) return std::log(speed / lower) / rate;
  return (std::pow(lower, 1.0 - power) - std::pow(speed, 1.0 - power)) / ((power - 1.0) * rate);
}

// Re(time)/Re(0) under eq. 4.2, where dRe/dt = -rate C_D Re^2 with rate = pi R mu_f / 4 m: a power
// law on each branch. Re only falls, so the branches are left one after the other, each at an
// instant known in closed form.
inline double chow_slowdown(double reynolds, double rate, double time)
{
  double ratio = 1.0;
  for (int i = chow_branch(reynolds); i > 0; --i) {
    const ChowBranch &branch = chow_branches[i];
    const double branch_rate = rate * branch.coefficient, power = 2.0 + branch.exponent;
    const double on_branch = slowdown(reynolds, branch_rate, power, time);
    if (reynolds * on_branch > branch.reynolds_above) return ratio * on_branch;
    time -= time_to_slow(reynolds, branch.reynolds_above, branch_rate, power);
    ratio *= branch.reynolds_above / reynolds;
    reynolds = branch.reynolds_above;
    if (time <= 0.0) return ratio;
  }
  return ratio * slowdown(reynolds, rate * chow_branches[0].coefficient, 1.0, time);
}

// u(time)/u(0) under eq. 3.6 with C_D constant, eq. 4.10: 1 / (1 + K u(0) time)
inline double quadratic_slowdown(const Medium &medium, double radius, double mass,
                                 double drag_coefficient, double speed, double time)
{
  return mass / (mass + dynamic_pressure_area(medium, radius) * drag_coefficient * speed * time);
}

// u(time)/u(0) under drag alone, exact for every law.
inline double drag_slowdown(const Medium &medium, double radius, double mass, double speed,
                            double time)
{
  switch (medium.law) {
  case DragLaw::constant:
    return quadratic_slowdown(medium, radius, mass, medium.drag_coefficient, speed, time);
  case DragLaw::chow:
    return chow_slowdown(reynolds_number(medium, radius, speed),
                         0.25 * pi * radius * medium.viscosity / mass, time);
  case DragLaw::stokes:
    return slowdown(speed, stokes_friction(medium, radius) / mass, 1.0, time);
  case DragLaw::none:
    break;
  }
  return 1.0;
}

// C_D where it is one and the same for every Reynolds number from `low` to `high`, else -1.
inline double common_drag_coefficient(const Medium &medium, double low, double high)
{
  if (medium.law == DragLaw::constant) return medium.drag_coefficient;
  if (medium.law != DragLaw::chow) return -1.0;
  const ChowBranch &branch = chow_branches[chow_branch(high)];
  return branch.exponent == 0.0 && low > branch.reynolds_above ? branch.coefficient : -1.0;
}

// Velocity after its part relative to the medium has changed by a factor.
inline Vector3 slowed(const Vector3 &velocity, const Vector3 &medium_velocity, double factor)
{
  return velocity + (factor - 1.0) * (velocity - medium_velocity);
}

} // namespace blast

#endif
