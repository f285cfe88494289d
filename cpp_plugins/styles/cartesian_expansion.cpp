#include "cartesian_expansion.h"

#include "near_field_powers.h"
#include "vector_clones.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

using namespace LAMMPS_NS;
using blast::Vector3;

static constexpr int LANES = Lanes::COUNT;

namespace {

using MultiIndex = std::array<int, 3>;

int total(const MultiIndex &n)
{
  return n[0] + n[1] + n[2];
}

int place_of(const MultiIndex &n)
{
  const int degree = total(n), rest = n[1] + n[2];
  return CartesianExpansion::count_up_to(degree - 1) + rest * (rest + 1) / 2 + n[2];
}

} // namespace

CartesianExpansion::CartesianExpansion(int order_) : order(order_), count(count_up_to(order_))
{
  std::vector<MultiIndex> indices;
  for (int d = 0; d <= order; d++)
    for (int rest = 0; rest <= d; rest++)
      for (int z = 0; z <= rest; z++) indices.push_back({d - rest, rest - z, z});

  for (const MultiIndex &n : indices) {
    const int axis = static_cast<int>(std::max_element(n.begin(), n.end()) - n.begin());
    MultiIndex lower = n, lowest = n;
    lower[axis] = std::max(0, n[axis] - 1);
    lowest[axis] = std::max(0, n[axis] - 2);
    steps.push_back(
        {place_of(lower), n[axis] > 1 ? place_of(lowest) : 0, axis, static_cast<double>(n[axis])});
    std::vector<std::uint16_t> row;
    for (int m = 0; m < count_up_to(order - total(n)); m++) {
      const MultiIndex &other = indices[m];
      row.push_back(static_cast<std::uint16_t>(
          place_of({n[0] + other[0], n[1] + other[1], n[2] + other[2]})));
    }
    sum.push_back(std::move(row));
  }
}

FarCells::FarCells(const CartesianExpansion &expansion)
    : moments(expansion.count), derivatives(expansion.count), locals(expansion.count)
{
}

void FarCells::add(const Vector3 &offset_of_cell, const double *moments_of_cell)
{
  offset[0].at[size] = offset_of_cell.x;
  offset[1].at[size] = offset_of_cell.y;
  offset[2].at[size] = offset_of_cell.z;
  for (size_t m = 0; m < moments.size(); m++) moments[m].at[size] = moments_of_cell[m];
  size++;
}

namespace {

// Monomials offset^n / n! times a first one, by lanes.
BLAST_INLINE void find_monomials(const CartesianExpansion &expansion, int count,
                                 const Lanes (&offset)[3], const Lanes &first, Lanes *monomials)
{
  monomials[0] = first;
  for (int n = 1; n < count; n++) {
    const CartesianExpansion::Step step = expansion.steps[n];
    const double inverse = 1.0 / step.power;
    const Lanes &lower = monomials[step.lower], &along = offset[step.axis];
#pragma omp simd
    for (int w = 0; w < LANES; w++) monomials[n].at[w] = inverse * along.at[w] * lower.at[w];
  }
}

// The next particles of a range, as offsets from a centre; lanes to spare repeat the last.
BLAST_INLINE int load_offsets(const FieldSources &particles, Range range, const Vector3 &centre,
                              Lanes (&offset)[3])
{
  const int filled = std::min(LANES, range.size());
  for (int w = 0; w < LANES; w++) {
    const int k = range.begin + std::min(w, filled - 1);
    offset[0].at[w] = particles.x[k] - centre.x;
    offset[1].at[w] = particles.y[k] - centre.y;
    offset[2].at[w] = particles.z[k] - centre.z;
  }
  return filled;
}

std::vector<double> monomials_of(const CartesianExpansion &expansion, const Vector3 &offset)
{
  const double along[] = {offset.x, offset.y, offset.z};
  std::vector<double> monomials(expansion.count, 1.0);
  for (int n = 1; n < expansion.count; n++) {
    const CartesianExpansion::Step &step = expansion.steps[n];
    monomials[n] = along[step.axis] / step.power * monomials[step.lower];
  }
  return monomials;
}

// Derivatives of the potential by lanes, from those by (1/d) d/dd: each raised by one multi-index
// after the other.
BLAST_INLINE void find_derivatives(const CartesianExpansion &expansion,
                                   const blast::NearField &field, bool energies, FarCells &cells)
{
  const double attraction_exponent = field.attraction.power.exponent;
  const double repulsion_exponent = field.repulsion.power.exponent;
  Lanes radial[CartesianExpansion::HIGHEST_ORDER + 1], attraction, repulsion, inverse;
  const Lanes *offset = cells.offset;
  with_law_of(field, [&](const auto &law) __attribute__((always_inline)) {
#pragma omp simd
    for (int w = 0; w < LANES; w++) {
      const double square = offset[0].at[w] * offset[0].at[w] + offset[1].at[w] * offset[1].at[w] +
                            offset[2].at[w] * offset[2].at[w];
      const double root = 1.0 / std::sqrt(square);
      inverse.at[w] = root * root;
      attraction.at[w] = law.attraction * law.attraction_power(root) * root;
      repulsion.at[w] = law.repulsion * law.repulsion_power(root) * root;
    }
    return 0.0;
  });
  for (int m = 1; m <= expansion.order; m++) {
    const double of_attraction = blast::radial_derivative_factor(attraction_exponent, m);
    const double of_repulsion = blast::radial_derivative_factor(repulsion_exponent, m);
#pragma omp simd
    for (int w = 0; w < LANES; w++) {
      radial[m].at[w] = attraction.at[w] - repulsion.at[w];
      attraction.at[w] *= of_attraction * inverse.at[w];
      repulsion.at[w] *= of_repulsion * inverse.at[w];
    }
  }
  for (int w = 0; w < LANES; w++)
    radial[0].at[w] =
        energies ? blast::bare_near_field_energy(field, 1.0 / std::sqrt(inverse.at[w]), 0.0) : 0.0;

  Lanes *derivatives = cells.derivatives.data();
  for (int m = expansion.order; m >= 0; m--) {
    for (int n = CartesianExpansion::count_up_to(expansion.order - m) - 1; n > 0; n--) {
      const CartesianExpansion::Step step = expansion.steps[n];
      const Lanes &along = offset[step.axis], &lower = derivatives[step.lower];
      const Lanes &lowest = derivatives[step.lowest];
      const double below = step.power - 1.0; // zero where there is no lowest
#pragma omp simd
      for (int w = 0; w < LANES; w++)
        derivatives[n].at[w] = along.at[w] * lower.at[w] + below * lowest.at[w];
    }
    derivatives[0] = radial[m];
  }
}

// Vectors of the compiler's: several sums stay in registers while the moments pass by, which loops
// over lanes do not achieve.
using NarrowVector = double __attribute__((vector_size(32)));
using WideVector = double __attribute__((vector_size(64)));

template <class Vector> BLAST_INLINE void load(const Lanes &lanes, int first, Vector &vector)
{
  std::memcpy(&vector, lanes.at + first, sizeof vector);
}

// ROWS local coefficients of the same degree, from number n on.
template <class Vector, int ROWS>
BLAST_INLINE void contract_rows(const CartesianExpansion &expansion, FarCells &cells, int n,
                                int first)
{
  const Lanes *derivatives = cells.derivatives.data(), *moments = cells.moments.data();
  const int raised = static_cast<int>(expansion.sum[n].size());
  const std::uint16_t *place[ROWS];
  Vector local[ROWS];
  for (int row = 0; row < ROWS; row++) {
    place[row] = expansion.sum[n + row].data();
    load(cells.locals[n + row], first, local[row]);
  }
  for (int m = 0; m < raised; m++) {
    Vector moment, derivative;
    load(moments[m], first, moment);
    for (int row = 0; row < ROWS; row++) {
      load(derivatives[place[row][m]], first, derivative);
      local[row] += derivative * moment;
    }
  }
  for (int row = 0; row < ROWS; row++)
    std::memcpy(cells.locals[n + row].at + first, &local[row], sizeof(Vector));
}

template <class Vector>
BLAST_INLINE void contract(const CartesianExpansion &expansion, bool energies, FarCells &cells)
{
  constexpr int width = sizeof(Vector) / sizeof(double);
  for (int first = 0; first < LANES; first += width)
    for (int degree = energies ? 0 : 1; degree <= expansion.order; degree++) {
      int n = CartesianExpansion::count_up_to(degree - 1);
      const int end = CartesianExpansion::count_up_to(degree);
      for (; n + 4 <= end; n += 4) contract_rows<Vector, 4>(expansion, cells, n, first);
      for (; n + 2 <= end; n += 2) contract_rows<Vector, 2>(expansion, cells, n, first);
      if (n < end) contract_rows<Vector, 1>(expansion, cells, n, first);
    }
}

BLAST_WIDE void receive_wide(const CartesianExpansion &expansion, const blast::NearField &field,
                             bool energies, FarCells &cells)
{
  find_derivatives(expansion, field, energies, cells);
  contract<WideVector>(expansion, energies, cells);
}

BLAST_NARROW_CLONES void receive_narrow(const CartesianExpansion &expansion,
                                        const blast::NearField &field, bool energies,
                                        FarCells &cells)
{
  find_derivatives(expansion, field, energies, cells);
  contract<NarrowVector>(expansion, energies, cells);
}

} // namespace

namespace LAMMPS_NS {

BLAST_VECTOR_CLONES void find_moments(const CartesianExpansion &expansion,
                                      const FieldSources &particles, Range range,
                                      const Vector3 &centre, double *moments)
{
  std::vector<Lanes> monomials(expansion.count);
  std::fill(moments, moments + expansion.count, 0.0);
  for (; !range.empty(); range.begin += LANES) {
    Lanes offset[3], factor = {};
    const int filled = load_offsets(particles, range, centre, offset);
    for (Lanes &along : offset)
      for (double &component : along.at) component = -component;
    for (int w = 0; w < filled; w++) factor.at[w] = particles.factor[range.begin + w];
    find_monomials(expansion, expansion.count, offset, factor, monomials.data());
    for (int m = 0; m < expansion.count; m++) {
      double moment = 0.0;
#pragma omp simd reduction(+ : moment)
      for (int w = 0; w < LANES; w++) moment += monomials[m].at[w];
      moments[m] += moment;
    }
  }
}

void shift_moments(const CartesianExpansion &expansion, const double *from, const Vector3 &offset,
                   double *to)
{
  const std::vector<double> monomials = monomials_of(expansion, -1.0 * offset);
  for (int m = 0; m < expansion.count; m++) {
    const std::vector<std::uint16_t> &raised = expansion.sum[m];
    for (size_t k = 0; k < raised.size(); k++) to[raised[k]] += from[m] * monomials[k];
  }
}

void receive(const CartesianExpansion &expansion, const blast::NearField &field, bool energies,
             FarCells &cells)
{
  for (; !cells.is_full(); cells.size++) {
    cells.offset[0].at[cells.size] = 1.0;
    cells.offset[1].at[cells.size] = cells.offset[2].at[cells.size] = 0.0;
    for (Lanes &moment : cells.moments) moment.at[cells.size] = 0.0;
  }
  if (has_wide_vectors())
    receive_wide(expansion, field, energies, cells);
  else
    receive_narrow(expansion, field, energies, cells);
  cells.size = 0;
}

void collect_locals(FarCells &cells, double *locals)
{
  for (size_t n = 0; n < cells.locals.size(); n++) {
    for (const double local : cells.locals[n].at) locals[n] += local;
    cells.locals[n] = {};
  }
}

void shift_locals(const CartesianExpansion &expansion, const double *from, const Vector3 &offset,
                  double *to)
{
  const std::vector<double> monomials = monomials_of(expansion, offset);
  for (int n = 0; n < expansion.count; n++) {
    const std::vector<std::uint16_t> &raised = expansion.sum[n];
    double local = 0.0;
    for (size_t k = 0; k < raised.size(); k++) local += from[raised[k]] * monomials[k];
    to[n] = local;
  }
}

BLAST_VECTOR_CLONES void evaluate_locals(const CartesianExpansion &expansion, const double *locals,
                                         const Vector3 &centre, const FieldSources &particles,
                                         Range range, FieldForces &forces, double *potential)
{
  std::vector<Lanes> monomials(expansion.count);
  Lanes one;
  std::fill(one.at, one.at + LANES, 1.0);
  const int below = CartesianExpansion::count_up_to(expansion.order - 1);
  const std::uint16_t *raised[] = {expansion.sum[1].data(), expansion.sum[2].data(),
                                   expansion.sum[3].data()};
  for (; !range.empty(); range.begin += LANES) {
    Lanes offset[3], gradient[3] = {}, value = {};
    const int filled = load_offsets(particles, range, centre, offset);
    const int needed = potential ? expansion.count : below;
    find_monomials(expansion, needed, offset, one, monomials.data());
    for (int n = 0; n < below; n++)
      for (int axis = 0; axis < 3; axis++) {
        const double local = locals[raised[axis][n]];
#pragma omp simd
        for (int w = 0; w < LANES; w++) gradient[axis].at[w] += local * monomials[n].at[w];
      }
    for (int w = 0; w < filled; w++) {
      forces.x[range.begin + w] -= gradient[0].at[w];
      forces.y[range.begin + w] -= gradient[1].at[w];
      forces.z[range.begin + w] -= gradient[2].at[w];
    }
    if (!potential) continue;
    for (int n = 0; n < expansion.count; n++)
#pragma omp simd
      for (int w = 0; w < LANES; w++) value.at[w] += locals[n] * monomials[n].at[w];
    for (int w = 0; w < filled; w++) potential[range.begin + w] += value.at[w];
  }
}

} // namespace LAMMPS_NS
