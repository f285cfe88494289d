#include "particle_block.h"

#include "sphere.h"
#include "vector_clones.h"

#include "atom.h"

#include <algorithm>

using namespace LAMMPS_NS;
using blast::Gyration;
using blast::Medium;
using blast::Slowing;
using blast::Vector3;

ParticleBlock::ParticleBlock(const Atom &atom, int first, int count_)
    : count(count_), x(atom.x[first]), v(atom.v[first]), omega(atom.omega[first]), f(atom.f[first]),
      torque(atom.torque[first]), mass(atom.rmass + first), radius(atom.radius + first),
      charge(atom.q_flag ? atom.q + first : nullptr)
{
}

void BlockGyrations::work_out(const ParticleBlock &block, int count, double magnetic_strength,
                              double step)
{
  for (int j = 0; j < count; j++) {
    const double angle =
        step * blast::cyclotron_frequency(block.charge[j], block.mass[j], magnetic_strength);
    if (std::fabs(angle) != last_angle) {
      last_angle = std::fabs(angle);
      last = Gyration(last_angle);
    }
    of[j] = angle < 0.0 ? last.reversed() : last;
  }
}

namespace {

BLAST_INLINE bool any_differs(const double *values, int count, double value)
{
  double difference = 0.0;
#pragma omp simd reduction(+ : difference)
  for (int k = 0; k < count; k++) difference += std::fabs(values[k] - value);
  return difference != 0.0;
}

BLAST_INLINE bool all_equal(const double *values, int count)
{
  return !any_differs(values, count, values[0]);
}

// Laws of drag over half a step.

struct NoDrag {
  static constexpr bool acts = false;
  Slowing operator()(double /*radius*/, double /*mass*/, double /*speed*/) const { return {}; }
};

struct QuadraticDrag {
  static constexpr bool acts = true;
  Medium medium;
  double drag_coefficient, time;
  Slowing operator()(double radius, double mass, double speed) const
  {
    return blast::quadratic_slowing(medium, radius, mass, drag_coefficient, speed, time);
  }
};

struct EqualDrag { // of spheres of one size and mass, under Stokes' law
  static constexpr bool acts = true;
  Slowing slowing;
  Slowing operator()(double /*radius*/, double /*mass*/, double /*speed*/) const { return slowing; }
};

// Where a step brings the particles of a block, kept apart until it is known to be right.
struct Moved {
  double x[ParticleBlock::CAPACITY], y[ParticleBlock::CAPACITY], z[ParticleBlock::CAPACITY];
  double vx[ParticleBlock::CAPACITY], vy[ParticleBlock::CAPACITY], vz[ParticleBlock::CAPACITY];
  double low = INFINITY, high = 0.0; // range of radius times speed relative to the medium
  double most_lost = 0.0;            // largest part of such a speed lost in half a step
  DriftWork work;

  BLAST_INLINE void store(ParticleBlock block) const
  {
#pragma omp simd
    for (int j = 0; j < block.count; j++) {
      Vector3(x[j], y[j], z[j]).store(block.x + 3 * j);
      Vector3(vx[j], vy[j], vz[j]).store(block.v + 3 * j);
    }
  }
};

// The step itself. Arguments that the loop reads are copies, so that nothing seems to change them.
template <class Drag, class GyrationOf>
BLAST_INLINE void move(const ParticleBlock block, const Vector3 wind, const Drag slowing_of,
                       const GyrationOf gyration_of, const Vector3 axis, double step, Moved &moved)
{
  double low = INFINITY, high = 0.0, most_lost = 0.0, drag_work = 0.0, magnetic_work = 0.0;
#pragma omp simd reduction(+ : drag_work, magnetic_work) reduction(min : low)                      \
    reduction(max : high, most_lost)
  for (int j = 0; j < block.count; j++) {
    const double mass = block.mass[j], radius = block.radius[j];
    Vector3 position = block.position(j), velocity = block.velocity(j);
    const auto slow = [&]() {
      if (!Drag::acts) return;
      const double speed = norm(velocity - wind);
      const Slowing slowing = slowing_of(radius, mass, speed);
      velocity = blast::slowed_a_little(velocity, wind, slowing.lost);
      high = std::max(high, radius * speed);
      low = std::min(low, radius * speed * slowing.kept);
      most_lost = slowing.lost > most_lost ? slowing.lost : most_lost;
    };

    const double at_start = dot(velocity, velocity);
    slow();
    const double before_turn = dot(velocity, velocity);
    const Gyration &gyration = gyration_of(j);
    gyrate(gyration, axis, step, position, velocity);
    const double after_turn = dot(velocity, velocity);
    slow();
    const double at_end = dot(velocity, velocity);

    moved.x[j] = position.x, moved.y[j] = position.y, moved.z[j] = position.z;
    moved.vx[j] = velocity.x, moved.vy[j] = velocity.y, moved.vz[j] = velocity.z;
    drag_work += 0.5 * mass * ((before_turn - at_start) + (at_end - after_turn));
    magnetic_work += 0.5 * mass * (after_turn - before_turn);
  }
  moved.low = low;
  moved.high = high;
  moved.most_lost = most_lost;
  moved.work = {drag_work, magnetic_work};
}

// Drag over a time by the whole law, one particle after another; returns its work.
double slow_down(const ParticleBlock &block, const Medium &medium, double time)
{
  double work = 0.0;
  for (int j = 0; j < block.count; j++) {
    const Vector3 before = block.velocity(j);
    const double speed = norm(before - medium.velocity);
    const Slowing slowing = drag_slowing(medium, block.radius[j], block.mass[j], speed, time);
    const Vector3 after = blast::slowed(before, medium.velocity, slowing);
    after.store(block.v + 3 * j);
    work += 0.5 * block.mass[j] * (dot(after, after) - dot(before, before));
  }
  return work;
}

// Tries to move the block as a whole; false where that is not right for every particle in it: under
// Stokes' law for unequal spheres, where Chow's fit has more than one C_D for the Reynolds numbers
// met, and where drag takes so much that the rounding of the little that is left would show.
template <class GyrationOf>
BLAST_INLINE bool move_as_one(const ParticleBlock &block, const Medium &medium,
                              const GyrationOf &gyration_of, const Vector3 &axis, double step,
                              bool equal_spheres, Moved &moved)
{
  if (medium.law == blast::DragLaw::none) {
    move(block, {}, NoDrag(), gyration_of, axis, step, moved);
    return true;
  }
  const double radius = block.radius[0], speed = norm(block.velocity(0) - medium.velocity);
  if (medium.law == blast::DragLaw::stokes) {
    if (!equal_spheres) return false;
    const EqualDrag drag{drag_slowing(medium, radius, block.mass[0], speed, 0.5 * step)};
    move(block, medium.velocity, drag, gyration_of, axis, step, moved);
    return moved.most_lost <= blast::little;
  }
  const double reynolds = reynolds_number(medium, radius, speed);
  const double drag_coefficient = common_drag_coefficient(medium, reynolds, reynolds);
  if (drag_coefficient < 0.0) return false;
  const QuadraticDrag drag{medium, drag_coefficient, 0.5 * step};
  move(block, medium.velocity, drag, gyration_of, axis, step, moved);
  return moved.most_lost <= blast::little &&
         common_drag_coefficient(medium, reynolds_number(medium, moved.low, 1.0),
                                 reynolds_number(medium, moved.high, 1.0)) == drag_coefficient;
}

template <class GyrationOf>
BLAST_INLINE DriftWork drift_with(const ParticleBlock &block, const Medium &medium,
                                  const GyrationOf &gyration_of, const Vector3 &axis, double step,
                                  bool equal_spheres)
{
  Moved moved;
  if (move_as_one(block, medium, gyration_of, axis, step, equal_spheres, moved)) {
    moved.store(block);
    return moved.work;
  }
  double drag_work = slow_down(block, medium, 0.5 * step);
  move(block, {}, NoDrag(), gyration_of, axis, step, moved);
  moved.store(block);
  drag_work += slow_down(block, medium, 0.5 * step);
  return {drag_work, moved.work.magnetic};
}

} // namespace

BLAST_VECTOR_CLONES
DriftWork LAMMPS_NS::drift(const ParticleBlock &block, const ExternalFields &fields,
                           BlockGyrations &gyrations, double step)
{
  const bool equal_spheres =
      all_equal(block.mass, block.count) && all_equal(block.radius, block.count);
  const bool turning = fields.magnetic_strength > 0.0;
  if (turning && !(equal_spheres && all_equal(block.charge, block.count))) {
    gyrations.work_out(block, block.count, fields.magnetic_strength, step);
    const Gyration *const own = gyrations.of;
    return drift_with(
        block, fields.medium, [own](int j) -> const Gyration & { return own[j]; }, fields.axis,
        step, equal_spheres);
  }
  Gyration shared;
  if (turning) {
    gyrations.work_out(block, 1, fields.magnetic_strength, step);
    shared = gyrations.of[0];
  }
  return drift_with(
      block, fields.medium, [&shared](int) -> const Gyration & { return shared; }, fields.axis,
      step, equal_spheres);
}

// Most particles of a cloud feel no such force, and looking costs less than dividing.
BLAST_VECTOR_CLONES
void LAMMPS_NS::kick(const ParticleBlock &block, double time)
{
  if (any_differs(block.f, 3 * block.count, 0.0)) {
#pragma omp simd
    for (int j = 0; j < block.count; j++) {
      const double gain = time / block.mass[j];
      (block.velocity(j) + gain * Vector3(block.f + 3 * j)).store(block.v + 3 * j);
    }
  }
  if (any_differs(block.torque, 3 * block.count, 0.0)) {
#pragma omp simd
    for (int j = 0; j < block.count; j++) {
      const double gain = time / blast::moment_of_inertia(block.mass[j], block.radius[j]);
      (Vector3(block.omega + 3 * j) + gain * Vector3(block.torque + 3 * j))
          .store(block.omega + 3 * j);
    }
  }
}
