#include "near_field_tree.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

using namespace LAMMPS_NS;
using blast::Vector3;
using Cell = NearFieldTree::Cell;

namespace {

struct Placed {
  std::array<double, 3> at;
  int index;
};

int longest_axis(const Vector3 &side)
{
  if (side.x >= side.y && side.x >= side.z) return 0;
  return side.y >= side.z ? 1 : 2;
}

Vector3 lowest(const Vector3 &a, const Vector3 &b)
{
  return {std::fmin(a.x, b.x), std::fmin(a.y, b.y), std::fmin(a.z, b.z)};
}

Vector3 highest(const Vector3 &a, const Vector3 &b)
{
  return {std::fmax(a.x, b.x), std::fmax(a.y, b.y), std::fmax(a.z, b.z)};
}

void halve(std::vector<Placed> &particles, Range range, int levels, int cell,
           std::vector<Cell> &cells)
{
  cells[cell].particles = range;
  if (levels == 0) return;
  Vector3 low(particles[range.begin].at.data()), high = low;
  for (int k = range.begin; k < range.end; k++) {
    low = lowest(low, Vector3(particles[k].at.data()));
    high = highest(high, Vector3(particles[k].at.data()));
  }
  const int axis = longest_axis(high - low), middle = range.begin + range.size() / 2;
  std::nth_element(particles.begin() + range.begin, particles.begin() + middle,
                   particles.begin() + range.end, [axis](const Placed &a, const Placed &b) {
                     return a.at[axis] != b.at[axis] ? a.at[axis] < b.at[axis] : a.index < b.index;
                   });
  halve(particles, {range.begin, middle}, levels - 1, 2 * cell + 1, cells);
  halve(particles, {middle, range.end}, levels - 1, 2 * cell + 2, cells);
}

void enclose_particles(const FieldSources &particles, Cell &leaf)
{
  const Range range = leaf.particles;
  leaf.low = leaf.high = particles.place(range.begin);
  for (int k = range.begin; k < range.end; k++) {
    leaf.low = lowest(leaf.low, particles.place(k));
    leaf.high = highest(leaf.high, particles.place(k));
  }
  leaf.centre = 0.5 * (leaf.low + leaf.high);
  leaf.radius = 0.0;
  for (int k = range.begin; k < range.end; k++)
    leaf.radius = std::fmax(leaf.radius, norm(particles.place(k) - leaf.centre));
}

void enclose_halves(const Cell &a, const Cell &b, Cell &whole)
{
  whole.low = lowest(a.low, b.low);
  whole.high = highest(a.high, b.high);
  whole.centre = 0.5 * (whole.low + whole.high);
  const double about_halves =
      std::fmax(norm(a.centre - whole.centre) + a.radius, norm(b.centre - whole.centre) + b.radius);
  whole.radius = std::fmin(0.5 * norm(whole.high - whole.low), about_halves);
}

} // namespace

std::vector<int> NearFieldTree::arrange(const FieldSources &particles, Range range, int leaf_size)
{
  int levels = 0;
  while ((range.size() - 1) >> levels >= leaf_size) levels++;
  cells.resize((2 << levels) - 1);

  std::vector<Placed> placed(range.size());
  for (int k = 0; k < range.size(); k++) {
    const int index = range.begin + k;
    placed[k] = {{particles.x[index], particles.y[index], particles.z[index]}, index};
  }
  halve(placed, {0, range.size()}, levels, 0, cells);
  for (Cell &cell : cells) {
    cell.particles.begin += range.begin;
    cell.particles.end += range.begin;
  }
  std::vector<int> order(placed.size());
  std::transform(placed.begin(), placed.end(), order.begin(),
                 [](const Placed &particle) { return particle.index; });
  return order;
}

void NearFieldTree::expand(const FieldSources &particles, const CartesianExpansion &expansion,
                           int threads)
{
  stride = expansion.count;
  moments.resize(cells.size() * stride);
  const int first = first_leaf(), all = static_cast<int>(cells.size());
  const auto moments_of_cell = [this](int c) { return &moments[static_cast<size_t>(c) * stride]; };
#pragma omp parallel for num_threads(threads) if (threads > 1)
  for (int c = first; c < all; c++) {
    enclose_particles(particles, cells[c]);
    find_moments(expansion, particles, cells[c].particles, cells[c].centre, moments_of_cell(c));
  }
  for (int begin = (first - 1) / 2, end = first; end > 0; end = begin, begin = (begin - 1) / 2) {
#pragma omp parallel for num_threads(threads) if (threads > 1)
    for (int c = begin; c < end; c++) {
      enclose_halves(cells[2 * c + 1], cells[2 * c + 2], cells[c]);
      std::fill_n(moments_of_cell(c), stride, 0.0);
      for (const int half : {2 * c + 1, 2 * c + 2})
        shift_moments(expansion, moments_of_cell(half), cells[half].centre - cells[c].centre,
                      moments_of_cell(c));
    }
  }
}

double NearFieldTree::memory_usage() const
{
  return cells.capacity() * sizeof(Cell) + moments.capacity() * sizeof(double);
}

namespace {

// A target cell on the way down: its local coefficients so far, and the source cells that it, or
// its halves, have still to meet.
struct Pending {
  int cell;
  std::vector<int> sources;
  std::vector<double> locals;
};

// Goes down the tree of targets, in one thread.
class Descent {
public:
  Descent(const TreeSummation &sum_, const NearFieldTree &targets_, Range wanted_,
          const NearFieldTree &sources_, FieldForces &forces_, double *potential_)
      : sum(sum_), targets(targets_), sources(sources_), wanted(wanted_), forces(forces_),
        potential(potential_), far_cells(sum.expansion)
  {
  }

  // Meets the sources of one cell; leaves in `halves` what its halves have to do.
  void visit(const Pending &pending, std::vector<Pending> &halves);
  void visit_all(const Pending &pending);

  SummationWork work;
  double nearest = INFINITY;

private:
  bool is_far(const Cell &a, const Cell &b) const;
  bool splits_target(int target, int source) const;
  void meet(int target, std::vector<int> &waiting, std::vector<double> &locals,
            std::vector<int> &deferred, std::vector<int> &near);
  void finish_leaf(int leaf, const std::vector<double> &locals, const std::vector<int> &near);
  void gather(const std::vector<int> &leaves);

  const TreeSummation &sum;
  const NearFieldTree &targets, &sources;
  const Range wanted;
  FieldForces &forces;
  double *potential;
  FarCells far_cells;
  FieldSources neighbours; // particles of leaves that lie near
};

bool Descent::is_far(const Cell &a, const Cell &b) const
{
  const Vector3 offset = a.centre - b.centre;
  const double reach = a.radius + b.radius, limit = sum.opening * sum.opening;
  return reach * reach < limit * dot(offset, offset);
}

// The larger of two cells is split, whichever is the target: the pairs of cells that meet must be
// the same from both sides.
bool Descent::splits_target(int target, int source) const
{
  if (targets.is_leaf(target) || sources.is_leaf(source)) return sources.is_leaf(source);
  const double a = targets.cells[target].radius, b = sources.cells[source].radius;
  if (a != b) return a > b;
  return &targets == &sources ? target < source : &targets < &sources;
}

void Descent::meet(int target, std::vector<int> &waiting, std::vector<double> &locals,
                   std::vector<int> &deferred, std::vector<int> &near)
{
  const Cell &cell = targets.cells[target];
  const Range both{std::max(cell.particles.begin, wanted.begin),
                   std::min(cell.particles.end, wanted.end)};
  const double wanted_part = static_cast<double>(both.size()) / cell.particles.size();
  while (!waiting.empty()) {
    const int source = waiting.back();
    waiting.pop_back();
    const bool is_itself = &targets == &sources && source == target;
    if (!is_itself && is_far(cell, sources.cells[source])) {
      far_cells.add(cell.centre - sources.cells[source].centre, sources.moments_of(source));
      if (far_cells.is_full()) receive(sum.expansion, sum.field, potential != nullptr, far_cells);
      work.far += wanted_part;
    } else if (targets.is_leaf(target) && sources.is_leaf(source)) {
      near.push_back(source);
    } else if (is_itself) {
      deferred.insert(deferred.end(), {2 * source + 1, 2 * source + 2});
    } else if (splits_target(target, source)) {
      deferred.push_back(source);
    } else {
      waiting.insert(waiting.end(), {2 * source + 1, 2 * source + 2});
    }
  }
  if (far_cells.size > 0) receive(sum.expansion, sum.field, potential != nullptr, far_cells);
  collect_locals(far_cells, locals.data());
}

void Descent::visit(const Pending &pending, std::vector<Pending> &halves)
{
  const int target = pending.cell;
  std::vector<int> waiting = pending.sources, deferred, near;
  std::vector<double> locals = pending.locals;
  meet(target, waiting, locals, deferred, near);
  if (targets.is_leaf(target)) {
    finish_leaf(target, locals, near);
    return;
  }
  for (const int half : {2 * target + 1, 2 * target + 2}) {
    const Cell &cell = targets.cells[half];
    if (cell.particles.begin >= wanted.end || cell.particles.end <= wanted.begin) continue;
    halves.push_back({half, deferred, std::vector<double>(locals.size())});
    shift_locals(sum.expansion, locals.data(), cell.centre - targets.cells[target].centre,
                 halves.back().locals.data());
  }
}

void Descent::visit_all(const Pending &pending)
{
  std::vector<Pending> halves;
  visit(pending, halves);
  for (const Pending &half : halves) visit_all(half);
}

void Descent::gather(const std::vector<int> &leaves)
{
  int count = 0;
  for (const int leaf : leaves) count += sources.cells[leaf].particles.size();
  neighbours.resize(count);
  int to = 0;
  for (const int leaf : leaves) {
    const Range from = sources.cells[leaf].particles;
    const auto copy = [&from, to](const std::vector<double> &column, std::vector<double> &copied) {
      std::copy(column.begin() + from.begin, column.begin() + from.end, copied.begin() + to);
    };
    copy(sum.particles.x, neighbours.x);
    copy(sum.particles.y, neighbours.y);
    copy(sum.particles.z, neighbours.z);
    copy(sum.particles.factor, neighbours.factor);
    to += from.size();
  }
}

void Descent::finish_leaf(int leaf, const std::vector<double> &locals, const std::vector<int> &near)
{
  const Cell &cell = targets.cells[leaf];
  const Range range = cell.particles;
  evaluate_locals(sum.expansion, locals.data(), cell.centre, sum.particles, range, forces,
                  potential);

  std::vector<int> others;
  for (const int source : near)
    if (&targets != &sources || source != leaf) others.push_back(source);
  gather(others);
  const Range all{0, static_cast<int>(neighbours.x.size())};
  nearest = std::fmin(nearest, sum_from(sum.field, sum.particles, range, neighbours, all, forces));
  if (potential) sum_potential_from(sum.field, sum.particles, range, neighbours, all, potential);
  work.near += static_cast<double>(range.size()) * all.size();
  if (others.size() == near.size()) return;

  nearest = std::fmin(nearest, sum_among(sum.field, sum.particles, range, forces));
  if (potential)
    sum_potential_from(sum.field, sum.particles, range, sum.particles, range, potential);
  work.near += static_cast<double>(range.size()) * (range.size() - 1);
}

} // namespace

double TreeSummation::operator()(const NearFieldTree &targets, Range wanted,
                                 const NearFieldTree &sources, FieldForces &forces,
                                 double *potential, SummationWork &work) const
{
  // From the root down until there are enough cells for all threads, each several.
  constexpr size_t cells_per_thread = 8;
  const size_t enough = threads > 1 ? cells_per_thread * threads : 1;
  Descent first(*this, targets, wanted, sources, forces, potential);
  std::vector<Pending> level{{0, {0}, std::vector<double>(expansion.count, 0.0)}};
  while (!level.empty() && level.size() < enough) {
    std::vector<Pending> next;
    for (const Pending &pending : level) first.visit(pending, next);
    level = std::move(next);
  }
  double nearest = first.nearest, near = first.work.near, far = first.work.far;
#pragma omp parallel num_threads(threads) if (threads > 1) reduction(min : nearest)                \
    reduction(+ : near, far)
  {
    Descent descent(*this, targets, wanted, sources, forces, potential);
#pragma omp for schedule(dynamic)
    for (size_t k = 0; k < level.size(); k++) descent.visit_all(level[k]);
    nearest = std::fmin(nearest, descent.nearest);
    near += descent.work.near;
    far += descent.work.far;
  }
  work.near += near;
  work.far += far;
  return nearest;
}
