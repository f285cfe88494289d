// The adaptive step of section 8 and appendix C: whether a fixed-point iteration has converged, and
// by how much the step changes, from how fast it did (eq. C.5).

#ifndef BLAST_LAWS_STEP_CONTROL_H
#define BLAST_LAWS_STEP_CONTROL_H

#include <algorithm>
#include <cmath>

namespace blast {

struct StepControl {
  double tolerance = 5.0e-4; // TOL, of the iteration error
  int most_corrections = 10; // K_d
  double longest_step = 0.0; // Delta t_lim, s
  double safety = 1.0;       // multiplies Lambda_K; one in the paper

  static constexpr double smallest_factor = 0.1, largest_factor = 10.0;

  // Z_K <= 1; what is no number has not converged. Lambda_K aims at Z_K = 1, and restarts may come
  // nearer and nearer to it from above: rounding must not decide when that is near enough.
  bool accepts(double error) const { return error <= tolerance * (1.0 + 1.0e-6); }

  // Lambda_K of eq. C.5 with p = 2 and an initial error of one.
  double factor(double error, int corrections) const
  {
    if (!std::isfinite(error)) return smallest_factor;
    const double wanted = std::pow(tolerance, 0.5 / most_corrections);
    const double found = std::pow(error, 0.5 / corrections);
    return std::clamp(safety * wanted / found, smallest_factor, largest_factor);
  }

  // The step that follows one that was accepted.
  double step_after(double step, double error, int corrections) const
  {
    if (error == 0.0) return longest_step;
    return std::min(factor(error, corrections) * step, longest_step);
  }
};

// The iteration error of eq. C.5: how far the last correction moved the particles, over how far the
// whole step does; zero where nothing moves.
inline double iteration_error(double correction, double motion)
{
  return correction == 0.0 ? 0.0 : correction / motion;
}

} // namespace blast

#endif
