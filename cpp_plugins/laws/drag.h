// Drag of a sphere in a medium: constant C_D, Chow's fit and Stokes, as forces
// (eqs. 3.6, 4.2, 4.13) and as exact flows of the velocity under drag alone (eqs. 4.10, A.5 and
// their like).

#ifndef BLAST_LAWS_DRAG_H
#define BLAST_LAWS_DRAG_H

#include "sphere.h"
#include "vector3.h"

#include <cmath>

namespace blast {

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

// c of F = c (v_f - v): eq. 3.6 with C_D constant or from eq. 4.2, or eq. 4.13.
inline double drag_resistance(const Medium &medium, double radius, double relative_speed)
{
  double drag_coefficient = medium.drag_coefficient;
  switch (medium.law) {
  case DragLaw::none:
    return 0.0;
  case DragLaw::stokes:
    return stokes_friction(medium, radius);
  case DragLaw::chow: {
    const double reynolds = reynolds_number(medium, radius, relative_speed);
    // Eq. 4.2 is Stokes's law there, and C_D is infinite at rest.
    if (chow_branch(reynolds) == 0) return stokes_friction(medium, radius);
    drag_coefficient = chow_drag_coefficient(reynolds);
    break;
  }
  case DragLaw::constant:
    break;
  }
  return dynamic_pressure_area(medium, radius) * drag_coefficient * relative_speed;
}

// Force of the medium on a sphere.
inline Vector3 drag_force(const Medium &medium, double radius, const Vector3 &velocity)
{
  if (medium.law == DragLaw::none) return {};
  const Vector3 relative = medium.velocity - velocity;
  return drag_resistance(medium, radius, norm(relative)) * relative;
}

// What drag leaves of a speed relative to the medium, and what it takes: kept + lost = 1. Each is
// known to rounding, where one minus the other would not be: after a short time nearly all is kept,
// after a long one nearly all is lost.
struct Slowing {
  double kept = 1.0, lost = 0.0;
};

// One slowing after another.
inline Slowing then(const Slowing &first, const Slowing &second)
{
  return {first.kept * second.kept, first.lost + first.kept * second.lost};
}

// Slowing under du/dt = -rate u^power, power >= 1, exact.
inline Slowing slowing(double speed, double rate, double power, double time)
{
  double logarithm = rate * time; // of u(0)/u(time)
  if (power != 1.0) {
    const double growth = (power - 1.0) * rate * std::pow(speed, power - 1.0) * time;
    logarithm = std::log1p(growth) / (power - 1.0);
  }
  return {std::exp(-logarithm), -std::expm1(-logarithm)};
}

// Time in which du/dt = -rate u^power brings the speed down to `lower`.
inline double time_to_slow(double speed, double lower, double rate, double power)
{
  if (power == 1.0) return std::log(speed / lower) / rate;
  return (std::pow(lower, 1.0 - power) - std::pow(speed, 1.0 - power)) / ((power - 1.0) * rate);
}

// Slowing under eq. 4.2, where dRe/dt = -rate C_D Re^2 with rate = pi R mu_f / 4 m: a power law on
// each branch. Re only falls, so the branches are left one after the other, each at an instant
// known in closed form.
inline Slowing chow_slowing(double reynolds, double rate, double time)
{
  Slowing total;
  for (int i = chow_branch(reynolds); i > 0; --i) {
    const ChowBranch &branch = chow_branches[i];
    const double branch_rate = rate * branch.coefficient, power = 2.0 + branch.exponent;
    const Slowing here = slowing(reynolds, branch_rate, power, time);
    if (reynolds * here.kept > branch.reynolds_above) return then(total, here);
    const double end = branch.reynolds_above;
    total = then(total, {end / reynolds, (reynolds - end) / reynolds});
    time -= time_to_slow(reynolds, end, branch_rate, power);
    if (time <= 0.0) return total;
    reynolds = end;
  }
  return then(total, slowing(reynolds, rate * chow_branches[0].coefficient, 1.0, time));
}

// Slowing under eq. 3.6 with C_D constant, eq. 4.10: kept = 1 / (1 + K u time)
inline Slowing quadratic_slowing(const Medium &medium, double radius, double mass,
                                 double drag_coefficient, double speed, double time)
{
  const double swept = dynamic_pressure_area(medium, radius) * drag_coefficient * speed * time;
  const double per_mass = 1.0 / (mass + swept);
  return {mass * per_mass, swept * per_mass};
}

// Slowing under drag alone, exact for every law.
inline Slowing drag_slowing(const Medium &medium, double radius, double mass, double speed,
                            double time)
{
  switch (medium.law) {
  case DragLaw::constant:
    return quadratic_slowing(medium, radius, mass, medium.drag_coefficient, speed, time);
  case DragLaw::chow:
    return chow_slowing(reynolds_number(medium, radius, speed),
                        0.25 * pi * radius * medium.viscosity / mass, time);
  case DragLaw::stokes:
    return slowing(speed, stokes_friction(medium, radius) / mass, 1.0, time);
  case DragLaw::none:
    break;
  }
  return {};
}

// C_D where it is one and the same for every Reynolds number from `low` to `high`, else -1.
inline double common_drag_coefficient(const Medium &medium, double low, double high)
{
  if (medium.law == DragLaw::constant) return medium.drag_coefficient;
  if (medium.law != DragLaw::chow) return -1.0;
  const ChowBranch &branch = chow_branches[chow_branch(high)];
  return branch.exponent == 0.0 && low > branch.reynolds_above ? branch.coefficient : -1.0;
}

// Velocity after it has lost a part, not over `little`, of what it was relative to the medium.
constexpr double little = 0.5;

inline Vector3 slowed_a_little(const Vector3 &velocity, const Vector3 &medium_velocity, double lost)
{
  return velocity - lost * (velocity - medium_velocity);
}

// Velocity after any slowing of its part relative to the medium.
inline Vector3 slowed(const Vector3 &velocity, const Vector3 &medium_velocity,
                      const Slowing &slowing)
{
  if (slowing.lost <= little) return slowed_a_little(velocity, medium_velocity, slowing.lost);
  return medium_velocity + slowing.kept * (velocity - medium_velocity);
}

} // namespace blast

#endif
