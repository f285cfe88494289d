// Measures of a homogeneous sphere.

#ifndef BLAST_LAWS_SPHERE_H
#define BLAST_LAWS_SPHERE_H

namespace blast {

constexpr double pi = 3.14159265358979323846;

inline double sphere_surface(double radius)
{
  return 4.0 * pi * radius * radius;
}

inline double sphere_volume(double radius)
{
  return 4.0 / 3.0 * pi * radius * radius * radius;
}

// I = 2/5 m R^2, eq. 7.8
inline double moment_of_inertia(double mass, double radius)
{
  return 0.4 * mass * radius * radius;
}

} // namespace blast

#endif
