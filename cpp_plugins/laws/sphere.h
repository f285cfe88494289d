// Inertia of a homogeneous sphere.

#ifndef BLAST_LAWS_SPHERE_H
#define BLAST_LAWS_SPHERE_H

namespace blast {

// I = 2/5 m R^2, eq. 7.8
inline double moment_of_inertia(double mass, double radius)
{
  return 0.4 * mass * radius * radius;
}

} // namespace blast

#endif
