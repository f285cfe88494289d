// The fixed-point iteration for one step of the phi-trapezoid (section 8): from the forces at a
// tried state it works out the next one. Who evaluates the forces in between, and who decides when
// to stop, is up to the caller.
//
// Everything is kept by local index: between `begin` and `go_back` or the last `take` no atom may
// change its place.

#ifndef BLAST_STYLES_TRAPEZOID_ITERATION_H
#define BLAST_STYLES_TRAPEZOID_ITERATION_H

#include "anderson.h"
#include "energy_tally.h"
#include "external_fields.h"
#include "trapezoid.h"

#include "pointers.h"

#include <vector>

namespace LAMMPS_NS {

class TrapezoidIteration : protected Pointers {
public:
  explicit TrapezoidIteration(LAMMPS *lmp) : Pointers(lmp) {}

  int groupbit = 1;
  blast::Trapezoid trapezoid;
  bool solves_fields = false; // magnetic force and drag in closed form, not by iteration
  int anderson_depth = 0;     // zero: no acceleration

  // Adds magnetic force and drag to LAMMPS's forces; part of every evaluation.
  void add_external_forces(const ExternalFields &fields);

  // The present state and forces are those at the beginning of a step.
  void begin();

  // The step starts once more: the present state and forces are those at its beginning.
  void go_back();

  // Works out from the present forces, for a step of this length, where the particles should be at
  // its end. The first time, with the forces at the beginning, this is an explicit step.
  void correct(const ExternalFields &fields, double step);

  // Mixes the result with those before it, so that the next is nearer to the solution.
  void accelerate();

  // The result becomes the present state.
  void take();

  // How far the last result is from the present state, and from the beginning: sums over the
  // particles of this rank, m.
  double correction = 0.0, motion = 0.0;

  const double *result_position() const { return result.x.data(); }

  // Mean velocities and spins of the step, if the result is taken; then the work of drag and
  // magnetic force on the way, of this rank's particles.
  void work_out_means();
  const double *mean_velocity() const { return mean.v.data(); }
  const double *mean_spin() const { return mean.omega.data(); }
  void tally_work(FieldWorkTally &tally) const;

  // The particle of this rank that the last correction moves farthest, if there is one.
  struct Mover {
    int index = -1;
    double distance = -1.0; // m
  };
  Mover farthest_mover() const;

  const ExternalForces &external_forces() const { return external; }
  double memory_usage() const;

private:
  // Three numbers an atom.
  using Column = std::vector<double>;

  struct Motion {
    Column v, omega;
  };
  struct State : Motion {
    Column x;
  };
  struct Beginning : State {
    Column f, torque;
    ExternalForces external;
  };
  // What the fixed-point map makes of a motion, and how far that is from it.
  struct Iterate {
    Motion image, residual;
  };

  bool is_moved(int i) const;
  void solve_velocities(const ExternalFields &fields);
  void place();
  void forget_iterates();
  Iterate last_iterate() const;
  double product(const Motion &a, const Motion &b) const;
  blast::AndersonEquations equations(const Motion &residual) const;

  double step = 0.0;
  std::vector<double> inertia; // of each particle
  Beginning beginning;
  State result;
  Motion mean;
  ExternalForces external; // of the last evaluation
  ExternalForces solved;   // at the result, where they are solved for

  bool has_previous = false;
  Iterate previous;
  std::vector<Iterate> differences; // from one iterate to the next, the oldest first
};

} // namespace LAMMPS_NS

#endif
