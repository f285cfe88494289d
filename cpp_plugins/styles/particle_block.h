// Moves charged spheres a block at a time, in loops that compilers turn into vector instructions.
// The formulas are those of laws/.

#ifndef BLAST_STYLES_PARTICLE_BLOCK_H
#define BLAST_STYLES_PARTICLE_BLOCK_H

#include "external_fields.h"

namespace LAMMPS_NS {

class Atom;

// Particles that lie one after another in LAMMPS's arrays.
struct ParticleBlock {
  static constexpr int CAPACITY = 128;

  ParticleBlock(const Atom &atom, int first, int count);

  int count;
  double *x, *v, *omega;                             // three components a particle, from 3 j on
  const double *f, *torque, *mass, *radius, *charge; // charge may be missing without a field

  blast::Vector3 position(int j) const { return blast::Vector3(x + 3 * j); }
  blast::Vector3 velocity(int j) const { return blast::Vector3(v + 3 * j); }
};

// The gyrations of a block's particles over one step.
struct BlockGyrations {
  blast::Gyration of[ParticleBlock::CAPACITY];

  // Works out the first `count` of them.
  void work_out(const ParticleBlock &block, int count, double magnetic_strength, double step);

private:
  double last_angle = 0.0; // one sine for clouds of one charge-to-mass ratio
  blast::Gyration last;
};

// Work done on a block in one step.
struct DriftWork {
  double drag = 0.0, magnetic = 0.0;
};

// The forces and torques that LAMMPS itself has summed, over a time.
void kick(const ParticleBlock &block, double time);

// Half a step of drag, a step of gyration with drift, half a step of drag: each exact.
DriftWork drift(const ParticleBlock &block, const ExternalFields &fields, BlockGyrations &gyrations,
                double step);

} // namespace LAMMPS_NS

#endif
