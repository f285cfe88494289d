// The blast pulse (section 3.1): every particle gets the same speed, away from the centre of mass.

#ifndef BLAST_LAWS_PULSE_H
#define BLAST_LAWS_PULSE_H

#include "vector3.h"

#include <cmath>
#include <cstdint>
#include <random>

namespace blast {

// |dv| = sqrt(2 W / M), eq. 3.4
inline double pulse_speed(double energy, double total_mass)
{
  return std::sqrt(2.0 * energy / total_mass);
}

// A centre of mass is known to rounding only: particles nearer to it than this part of the cloud's
// radius and of its distance from the origin sit on it and have no direction of their own.
constexpr double centre_tolerance = 1.0e-12;

// Unit vector uniform on the sphere, a function of seed and particle id alone, so that the number
// of ranks does not matter.
inline Vector3 random_direction(std::uint64_t seed, std::uint64_t particle_id)
{
  std::seed_seq sequence{seed, seed >> 32, particle_id, particle_id >> 32};
  std::mt19937_64 generator(sequence);
  const auto symmetric = [&generator] {
    return std::ldexp(static_cast<double>(generator() >> 11), -52) - 1.0;
  };
  while (true) {
    const Vector3 trial(symmetric(), symmetric(), symmetric());
    const double square = dot(trial, trial);
    if (square > 0.0 && square <= 1.0) return (1.0 / std::sqrt(square)) * trial;
  }
}

} // namespace blast

#endif
