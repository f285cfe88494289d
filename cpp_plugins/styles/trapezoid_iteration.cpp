#include "trapezoid_iteration.h"

#include "sphere.h"
#include "vector_clones.h"

#include "atom.h"

#include <algorithm>
#include <cmath>
#include <mpi.h>

using namespace LAMMPS_NS;
using blast::Vector3;

using Column = std::vector<double>;

static Column copy_of(double **of_atoms, int count)
{
  return count == 0 ? Column() : Column(of_atoms[0], of_atoms[0] + 3 * count);
}

static void put_back(double **of_atoms, const Column &column)
{
  if (!column.empty()) std::copy(column.begin(), column.end(), of_atoms[0]);
}

static Vector3 of(const Column &column, int i)
{
  return Vector3(&column[3 * i]);
}

static Column difference(const Column &a, const Column &b)
{
  Column result(a.size());
  for (size_t k = 0; k < a.size(); k++) result[k] = a[k] - b[k];
  return result;
}

static Column half_way(const Column &a, const Column &b)
{
  Column result(a.size());
  for (size_t k = 0; k < a.size(); k++) result[k] = 0.5 * (a[k] + b[k]);
  return result;
}

static void subtract(Column &from, double factor, const Column &column)
{
  for (size_t k = 0; k < from.size(); k++) from[k] -= factor * column[k];
}

bool TrapezoidIteration::is_moved(int i) const
{
  return atom->mask[i] & groupbit;
}

void TrapezoidIteration::add_external_forces(const ExternalFields &fields)
{
  external.add(fields, *atom, groupbit);
}

void TrapezoidIteration::begin()
{
  const int nlocal = atom->nlocal;
  beginning.x = copy_of(atom->x, nlocal);
  beginning.v = copy_of(atom->v, nlocal);
  beginning.omega = copy_of(atom->omega, nlocal);
  beginning.f = copy_of(atom->f, nlocal);
  beginning.torque = copy_of(atom->torque, nlocal);
  beginning.external = external;
  inertia.resize(nlocal);
  for (int i = 0; i < nlocal; i++)
    inertia[i] = blast::moment_of_inertia(atom->rmass[i], atom->radius[i]);
  result.x = beginning.x; // where atoms outside the group stay
  result.v = beginning.v;
  result.omega = beginning.omega;
  if (solves_fields) solved = external;
  forget_iterates();
}

void TrapezoidIteration::go_back()
{
  put_back(atom->x, beginning.x);
  put_back(atom->v, beginning.v);
  put_back(atom->omega, beginning.omega);
  put_back(atom->f, beginning.f);
  put_back(atom->torque, beginning.torque);
  external = beginning.external;
  forget_iterates();
}

void TrapezoidIteration::forget_iterates()
{
  has_previous = false;
  differences.clear();
}

namespace {

// Which particles take part.
struct Group {
  const int *mask;
  int bit;

  BLAST_INLINE bool has(int i) const { return mask[i] & bit; }
};

// Eq. 8.1 of velocities and masses, or of spins and moments of inertia.
BLAST_VECTOR_CLONES
void kick(const blast::Trapezoid trapezoid, double step, int count, const Group group,
          const double *__restrict inertia, const double *__restrict old_velocity,
          const double *__restrict old_force, const double *__restrict force,
          double *__restrict velocity)
{
#pragma omp simd
  for (int i = 0; i < count; i++) {
    const double gain = group.has(i) ? step / inertia[i] : 0.0;
    const Vector3 mean = trapezoid.mean(Vector3(force + 3 * i), Vector3(old_force + 3 * i));
    (Vector3(old_velocity + 3 * i) + gain * mean).store(velocity + 3 * i);
  }
}

// Eq. 8.2; adds up how far that is from the present positions, and from the old ones.
BLAST_VECTOR_CLONES
void drift(const blast::Trapezoid trapezoid, double step, int count, const Group group,
           const double *__restrict old_position, const double *__restrict old_velocity,
           const double *__restrict velocity, const double *__restrict present,
           double *__restrict position, double &correction, double &motion)
{
  double corrections = 0.0, motions = 0.0;
#pragma omp simd reduction(+ : corrections, motions)
  for (int i = 0; i < count; i++) {
    const Vector3 mean = trapezoid.mean(Vector3(velocity + 3 * i), Vector3(old_velocity + 3 * i));
    const Vector3 old(old_position + 3 * i), place = old + (group.has(i) ? step : 0.0) * mean;
    place.store(position + 3 * i);
    corrections += norm(place - Vector3(present + 3 * i));
    motions += norm(place - old);
  }
  correction = corrections;
  motion = motions;
}

} // namespace

void TrapezoidIteration::correct(const ExternalFields &fields, double step_)
{
  step = step_;
  correction = motion = 0.0;
  if (atom->nlocal == 0) return;
  if (solves_fields)
    solve_velocities(fields);
  else
    kick(trapezoid, step, atom->nlocal, {atom->mask, groupbit}, atom->rmass, beginning.v.data(),
         beginning.f.data(), atom->f[0], result.v.data());
  kick(trapezoid, step, atom->nlocal, {atom->mask, groupbit}, inertia.data(),
       beginning.omega.data(), beginning.torque.data(), atom->torque[0], result.omega.data());
  place();
}

// The velocities that solve eq. 8.1 together with their own magnetic forces and drag.
void TrapezoidIteration::solve_velocities(const ExternalFields &fields)
{
  const blast::Medium &medium = fields.medium;
  const double new_part = trapezoid.phi * step;
  for (int i = 0; i < atom->nlocal; i++) {
    if (!is_moved(i)) continue;
    const double mass = atom->rmass[i];
    const Vector3 others = Vector3(atom->f[i]) - external.drag[i] - external.magnetic[i];
    const Vector3 driven =
        of(beginning.v, i) + (step / mass) * trapezoid.mean(others, of(beginning.f, i));
    // The resistance depends on the speed, if at all, so little that iterating it is enough.
    const double resistance =
        drag_resistance(medium, atom->radius[i], norm(Vector3(atom->v[i]) - medium.velocity));
    const double charge = fields.magnetic_strength > 0.0 ? atom->q[i] : 0.0;
    const double omega = blast::cyclotron_frequency(charge, mass, fields.magnetic_strength);
    const Vector3 velocity = turned_and_slowed(driven, new_part * omega, fields.axis,
                                               new_part * resistance / mass, medium.velocity);
    velocity.store(&result.v[3 * i]);
    solved.drag[i] = resistance * (medium.velocity - velocity);
    solved.magnetic[i] = magnetic_force(charge, velocity, fields.magnetic);
  }
}

void TrapezoidIteration::place()
{
  drift(trapezoid, step, atom->nlocal, {atom->mask, groupbit}, beginning.x.data(),
        beginning.v.data(), result.v.data(), atom->x[0], result.x.data(), correction, motion);
}

void TrapezoidIteration::take()
{
  put_back(atom->x, result.x);
  put_back(atom->v, result.v);
  put_back(atom->omega, result.omega);
}

// By Anderson: an iterate in which the residuals would cancel if the map were linear.
void TrapezoidIteration::accelerate()
{
  if (anderson_depth == 0) return;
  Iterate last = last_iterate();
  if (has_previous) {
    if (static_cast<int>(differences.size()) == anderson_depth)
      differences.erase(differences.begin());
    differences.push_back({{difference(last.image.v, previous.image.v),
                            difference(last.image.omega, previous.image.omega)},
                           {difference(last.residual.v, previous.residual.v),
                            difference(last.residual.omega, previous.residual.omega)}});
    double coefficient[blast::largest_anderson_depth];
    equations(last.residual).solve(coefficient);
    for (size_t j = 0; j < differences.size(); j++) {
      subtract(result.v, coefficient[j], differences[j].image.v);
      subtract(result.omega, coefficient[j], differences[j].image.omega);
    }
    if (atom->nlocal > 0) place();
  }
  previous = std::move(last);
  has_previous = true;
}

TrapezoidIteration::Iterate TrapezoidIteration::last_iterate() const
{
  const int nlocal = atom->nlocal;
  return {result,
          {difference(result.v, copy_of(atom->v, nlocal)),
           difference(result.omega, copy_of(atom->omega, nlocal))}};
}

// Twice the kinetic energy that belongs to two equal motions: the same in every frame of axes.
double TrapezoidIteration::product(const Motion &a, const Motion &b) const
{
  double sum = 0.0;
  for (int i = 0; i < atom->nlocal; i++) {
    sum += atom->rmass[i] * dot(of(a.v, i), of(b.v, i));
    sum += inertia[i] * dot(of(a.omega, i), of(b.omega, i));
  }
  return sum;
}

blast::AndersonEquations TrapezoidIteration::equations(const Motion &residual) const
{
  blast::AndersonEquations here;
  here.depth = static_cast<int>(differences.size());
  for (int i = 0; i < here.depth; i++) {
    here.with_residual[i] = product(differences[i].residual, residual);
    for (int j = 0; j <= i; j++)
      here.product[i][j] = product(differences[i].residual, differences[j].residual);
  }
  blast::AndersonEquations everywhere = here;
  constexpr int depth = blast::largest_anderson_depth;
  MPI_Allreduce(here.product, everywhere.product, depth * depth, MPI_DOUBLE, MPI_SUM, world);
  MPI_Allreduce(here.with_residual, everywhere.with_residual, depth, MPI_DOUBLE, MPI_SUM, world);
  for (int i = 0; i < here.depth; i++)
    for (int j = i + 1; j < here.depth; j++) everywhere.product[i][j] = everywhere.product[j][i];
  return everywhere;
}

void TrapezoidIteration::work_out_means()
{
  mean.v = half_way(result.v, beginning.v);
  mean.omega = half_way(result.omega, beginning.omega);
}

void TrapezoidIteration::tally_work(FieldWorkTally &tally) const
{
  const ExternalForces &acting = solves_fields ? solved : external;
  for (int i = 0; i < atom->nlocal; i++) {
    if (!is_moved(i)) continue;
    const Vector3 way = step * of(mean.v, i);
    const Vector3 drag = trapezoid.mean(acting.drag[i], beginning.external.drag[i]);
    const Vector3 magnetic = trapezoid.mean(acting.magnetic[i], beginning.external.magnetic[i]);
    tally.energy[DRAG_WORK] += dot(drag, way);
    tally.energy[MAGNETIC_WORK] += dot(magnetic, way);
  }
}

TrapezoidIteration::Mover TrapezoidIteration::farthest_mover() const
{
  Mover farthest;
  for (int i = 0; i < atom->nlocal; i++) {
    const double distance = norm(of(result.x, i) - Vector3(atom->x[i]));
    if (distance > farthest.distance || !std::isfinite(distance)) farthest = {i, distance};
    if (!std::isfinite(distance)) break;
  }
  return farthest;
}

double TrapezoidIteration::memory_usage() const
{
  const double columns = 5.0 + 3.0 + 2.0 + (anderson_depth > 0 ? 4.0 * (1 + anderson_depth) : 0.0);
  return columns * static_cast<double>(beginning.x.capacity() * sizeof(double)) +
         external.memory_usage() + solved.memory_usage() + beginning.external.memory_usage();
}
