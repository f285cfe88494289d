// Regularised friction, eqs. 7.11-7.15: stick as a stiffness against the slip of one time step,
// Coulomb's law beyond. It depends on the length of the step; the paper means it so.

#ifndef BLAST_LAWS_FRICTION_H
#define BLAST_LAWS_FRICTION_H

namespace blast {

struct Friction {
  double stiffness = 0.0;                                     // K_f
  double static_coefficient = 0.0, dynamic_coefficient = 0.0; // mu_s, mu_d

  bool acts() const { return stiffness > 0.0; }
};

// Force of a tangential stiffness against the slip of one step, eqs. 7.12 and 7.17.
inline double stick_force(double stiffness, double slip_speed, double area, double step)
{
  return stiffness * slip_speed * area * step;
}

// Magnitude of the friction along tau; `normal_force` is the elastic force of eq. 7.5.
inline double friction_force(const Friction &friction, double slip_speed, double area, double step,
                             double normal_force)
{
  const double trial = stick_force(friction.stiffness, slip_speed, area, step);
  const bool sticks = trial < friction.static_coefficient * normal_force;
  return sticks ? trial : friction.dynamic_coefficient * normal_force;
}

} // namespace blast

#endif
