// Moves charged spheres a block at a time, component by component, so that compilers turn the loops
// over a block into vector instructions. The formulas are those of laws/.

#ifndef BLAST_STYLES_PARTICLE_BLOCK_H
#define BLAST_STYLES_PARTICLE_BLOCK_H

#include "drag.h"
#include "lorentz.h"

namespace LAMMPS_NS {

struct ParticleBlock {
  static constexpr int CAPACITY = 64;

  int count = 0;
  int index[CAPACITY]; // LAMMPS's local index
  double x[CAPACITY], y[CAPACITY], z[CAPACITY];
  double vx[CAPACITY], vy[CAPACITY], vz[CAPACITY];
  double mass[CAPACITY], inverse_mass[CAPACITY], radius[CAPACITY];
  blast::Gyration gyration[CAPACITY];

  blast::Vector3 position(int j) const { return {x[j], y[j], z[j]}; }
  blast::Vector3 velocity(int j) const { return {vx[j], vy[j], vz[j]}; }
  void set_position(int j, const blast::Vector3 &r) { x[j] = r.x, y[j] = r.y, z[j] = r.z; }
  void set_velocity(int j, const blast::Vector3 &v) { vx[j] = v.x, vy[j] = v.y, vz[j] = v.z; }
};

// Work done on a block in one step.
struct DriftWork {
  double drag = 0.0, magnetic = 0.0;
};

// Half a step of drag, a step of gyration with drift, half a step of drag: each exact.
DriftWork drift(ParticleBlock &block, const blast::Medium &medium, const blast::Vector3 &axis,
                double step);

} // namespace LAMMPS_NS

#endif
