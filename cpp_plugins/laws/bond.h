// Bonds between particles that have been pressed together, eqs. 7.16 and 7.17.

#ifndef BLAST_LAWS_BOND_H
#define BLAST_LAWS_BOND_H

#include "power.h"

namespace blast {

struct Bond {
  double stiffness = 0.0;            // K_nb
  Power exponent;                    // p_b
  double activation_strain = 0.0;    // E*; zero: no bonds
  double tangential_stiffness = 0.0; // K_rb
  bool lasts = true; // once active, until the pair separates; else only while |E| >= E*

  bool acts() const { return activation_strain > 0.0; }
};

inline bool is_bonded(const Bond &bond, double strain, bool was_bonded)
{
  return strain >= bond.activation_strain || (bond.lasts && was_bonded);
}

// Magnitude of eq. 7.16, which pulls the particles together.
inline double bond_force(const Bond &bond, double strain, double area)
{
  return bond.stiffness * bond.exponent(strain) * area;
}

} // namespace blast

#endif
