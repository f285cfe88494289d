#include "all_pairs_sum.h"

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "neighbor.h"
#include "update.h"
#include "utils.h"

#include <algorithm>
#include <cmath>
#include <string>

using namespace LAMMPS_NS;
using blast::NearField;
using blast::Vector3;

namespace {

// Leaves of fewer particles have more cells to meet, of more particles more neighbours.
constexpr int LEAF_SIZE = 32;
// The error is measured on the particles of so many leaves, at the start and again when lists of
// neighbours are renewed after so many steps.
constexpr int SAMPLED_LEAVES = 64;
constexpr int STEPS_BETWEEN_CHOICES = 100;
// Or when so large a part of the particles has come or gone.
constexpr double CHANGE_OF_COUNT = 0.1;
// Of the accuracy asked for, what the sample may show: it is not the whole.
constexpr double PART_OF_ACCURACY = 0.5;
// Fewer particles than this are summed directly before anything is tried.
constexpr int FEWEST_FOR_TREE = 2000;

// What things cost, in interactions of one particle with one other: measured with vectors of 64
// bytes, and much the same with those of 32.
constexpr double MUTUAL_COST = 0.62; // the same, where both feel it at once
constexpr double CELL_COST = 250.0, CELL_COST_OF_TERM = 0.25;
constexpr double PARTICLE_COST_OF_COEFFICIENT = 0.5;

// Orders and openings, each the cheapest of its accuracy for a cloud of section 9; the error falls
// two- to threefold from one to the next.
struct Rung {
  int order;
  double opening;
};
constexpr Rung LADDER[] = {{2, 0.8},  {3, 0.8},  {4, 0.8},  {5, 0.75}, {6, 0.7}, {7, 0.7},
                           {7, 0.6},  {8, 0.6},  {9, 0.6},  {8, 0.5},  {9, 0.5}, {10, 0.5},
                           {11, 0.5}, {12, 0.5}, {13, 0.5}, {14, 0.45}};
constexpr int RUNGS = sizeof(LADDER) / sizeof(LADDER[0]);

Range common(const Range &a, const Range &b)
{
  return {std::max(a.begin, b.begin), std::min(a.end, b.end)};
}

Range part(int count, int number, int of)
{
  const bigint all = count;
  return {static_cast<int>(all * number / of), static_cast<int>(all * (number + 1) / of)};
}

bool same_law(const NearField &a, const NearField &b)
{
  const auto same = [](const blast::PowerLaw &p, const blast::PowerLaw &q) {
    return p.strength == q.strength && p.power.exponent == q.power.exponent;
  };
  return same(a.attraction, b.attraction) && same(a.repulsion, b.repulsion);
}

} // namespace

AllPairsSum::AllPairsSum(LAMMPS *lmp, SummationMethod method_, double accuracy_,
                         FieldOfTypes field_of_types_)
    : Pointers(lmp), method(method_), accuracy(accuracy_), field_of_types(field_of_types_),
      particles(lmp), rung(first_rung())
{
}

int AllPairsSum::first_rung() const
{
  return static_cast<int>(std::clamp(-2.0 * std::log10(accuracy) - 2.0, 0.0, RUNGS - 1.0));
}

void AllPairsSum::forget_choice()
{
  chosen_at = -1;
  rung = first_rung();
}

// Types that feel and exert the same near field belong to one group.
void AllPairsSum::group_types()
{
  const int types = atom->ntypes;
  group_of_type.assign(types + 1, -1);
  type_of_group.clear();
  for (int t = 1; t <= types; t++) {
    for (size_t g = 0; g < type_of_group.size() && group_of_type[t] < 0; g++) {
      bool same = true;
      for (int u = 1; u <= types; u++)
        same = same && same_law(field_of_types(t, u), field_of_types(type_of_group[g], u));
      if (same) group_of_type[t] = static_cast<int>(g);
    }
    if (group_of_type[t] >= 0) continue;
    group_of_type[t] = static_cast<int>(type_of_group.size());
    type_of_group.push_back(t);
  }
}

const NearField &AllPairsSum::field_between(int group, int other) const
{
  return field_of_types(type_of_group[group], type_of_group[other]);
}

bool AllPairsSum::compute(const std::vector<double> &factors, bool energies)
{
  const bool anew = neighbor->ago == 0;
  if (anew) {
    group_types();
    particles.arrange(group_of_type, static_cast<int>(type_of_group.size()));
  }
  particles.gather(factors);
  if (anew && method != SummationMethod::direct) {
    const bool choosing = is_time_to_choose();
    if (choosing || used.order > 0) grow_trees();
    if (choosing) choose();
  }
  forces.clear(particles.count());
  potentials.assign(energies ? particles.count() : 0, 0.0);
  double nearest = used.order > 0 ? sum_by_tree(energies) : sum_directly();
  if (energies && used.order == 0) find_potentials_directly();
  for (auto *column : {&forces.x, &forces.y, &forces.z, &potentials})
    particles.add_up_ranks(*column);
  MPI_Allreduce(MPI_IN_PLACE, &nearest, 1, MPI_DOUBLE, MPI_MIN, world);
  return nearest == 0.0;
}

Vector3 AllPairsSum::force_on(int i) const
{
  const int at = particles.own_place[i];
  return {forces.x[at], forces.y[at], forces.z[at]};
}

// All pairs of blocks meet as in a tournament: in each round every worker, a thread of a rank, has
// two blocks of its own, and each feels the other at once.
double AllPairsSum::sum_directly()
{
  const int threads = comm->nthreads, workers = threads * comm->nprocs, blocks = 2 * workers;
  const int first_worker = threads * comm->me, rest = blocks - 1;
  const auto block = [this, blocks](int number) { return part(particles.count(), number, blocks); };
  double nearest = INFINITY;
#pragma omp parallel num_threads(threads) if (threads > 1) reduction(min : nearest)
  {
#pragma omp for schedule(static, 1)
    for (int worker = first_worker; worker < first_worker + threads; worker++)
      nearest = std::fmin(nearest, sum_block({block(2 * worker).begin, block(2 * worker + 1).end}));
    for (int round = 0; round < rest; round++) {
#pragma omp for schedule(static, 1)
      for (int worker = first_worker; worker < first_worker + threads; worker++) {
        const int a = worker == 0 ? rest : (round + worker) % rest;
        const int b = worker == 0 ? round : (round - worker + rest) % rest;
        if (a / 2 != b / 2) nearest = std::fmin(nearest, sum_blocks(block(a), block(b)));
      }
    }
  }
  return nearest;
}

double AllPairsSum::sum_block(Range block)
{
  double nearest = INFINITY;
  for (size_t g = 0; g < particles.groups.size(); g++) {
    const Range targets = common(block, particles.groups[g]);
    if (targets.empty()) continue;
    nearest =
        std::fmin(nearest, sum_among(field_between(g, g), particles.sources, targets, forces));
    for (size_t h = g + 1; h < particles.groups.size(); h++)
      nearest = std::fmin(nearest, sum_between(field_between(g, h), particles.sources, targets,
                                               common(block, particles.groups[h]), forces));
  }
  return nearest;
}

double AllPairsSum::sum_blocks(Range a, Range b)
{
  double nearest = INFINITY;
  for (size_t g = 0; g < particles.groups.size(); g++)
    for (size_t h = 0; h < particles.groups.size(); h++) {
      const Range of_a = common(a, particles.groups[g]), of_b = common(b, particles.groups[h]);
      if (!of_a.empty() && !of_b.empty())
        nearest = std::fmin(
            nearest, sum_between(field_between(g, h), particles.sources, of_a, of_b, forces));
    }
  return nearest;
}

void AllPairsSum::find_potentials_directly()
{
  const int threads = comm->nthreads, workers = threads * comm->nprocs;
#pragma omp parallel for num_threads(threads) if (threads > 1)
  for (int thread = 0; thread < threads; thread++) {
    const Range share = part(particles.count(), threads * comm->me + thread, workers);
    for (size_t g = 0; g < particles.groups.size(); g++)
      for (size_t h = 0; h < particles.groups.size(); h++)
        sum_potential_from(field_between(g, h), particles.sources,
                           common(share, particles.groups[g]), particles.sources,
                           particles.groups[h], potentials.data());
  }
}

void AllPairsSum::grow_trees()
{
  trees.resize(particles.groups.size());
  for (size_t g = 0; g < trees.size(); g++) {
    const Range group = particles.groups[g];
    if (!group.empty())
      particles.reorder(group.begin, trees[g].arrange(particles.sources, group, LEAF_SIZE));
  }
}

void AllPairsSum::expand_trees()
{
  for (size_t g = 0; g < trees.size(); g++)
    if (!particles.groups[g].empty())
      trees[g].expand(particles.sources, *expansion, comm->nthreads);
}

// Whole leaves, as many on each rank.
Range AllPairsSum::share_of(const NearFieldTree &tree) const
{
  const Range leaves = part(tree.leaves(), comm->me, comm->nprocs);
  return leaves.empty() ? Range{0, 0} : tree.particles_of_leaves(leaves.begin, leaves.end);
}

double AllPairsSum::sum_by_tree(bool energies)
{
  double nearest = INFINITY;
  SummationWork work;
  const int groups = static_cast<int>(trees.size());
  expand_trees();
  for (int g = 0; g < groups; g++) {
    const Range share = particles.groups[g].empty() ? Range{0, 0} : share_of(trees[g]);
    for (int h = 0; h < groups; h++) {
      if (share.empty() || particles.groups[h].empty()) continue;
      const TreeSummation sum{field_between(g, h), *expansion, used.opening, comm->nthreads,
                              particles.sources};
      nearest = std::fmin(nearest, sum(trees[g], share, trees[h], forces,
                                       energies ? potentials.data() : nullptr, work));
    }
  }
  return nearest;
}

bool AllPairsSum::is_time_to_choose() const
{
  return chosen_at < 0 || std::abs(particles.count() - chosen_for) > CHANGE_OF_COUNT * chosen_for ||
         update->ntimestep < chosen_at || update->ntimestep >= chosen_at + STEPS_BETWEEN_CHOICES;
}

// Takes the cheapest rung of the ladder that is accurate on a sample of the particles, or the
// direct sum where that is cheaper or no rung is accurate enough.
void AllPairsSum::choose()
{
  chosen_at = update->ntimestep;
  chosen_for = particles.count();
  if (particles.count() < 2 ||
      (method == SummationMethod::automatic && particles.count() < FEWEST_FOR_TREE)) {
    use({}, cost_of_direct_sum());
    return;
  }
  sample_leaves();
  find_sampled_forces();
  Trial trial;
  const bool found = find_cheapest_trial(trial);
  if (found && (method == SummationMethod::tree || trial.cost < cost_of_direct_sum()))
    use(trial.approximation, trial.cost);
  else if (use({}, cost_of_direct_sum()) && !found && method == SummationMethod::tree &&
           comm->me == 0)
    error->warning(FLERR, "Pair blast/nearfield: no tree reaches accuracy {:g}", accuracy);
}

// Every rank takes a part of the sample.
void AllPairsSum::sample_leaves()
{
  sample.clear();
  const double part_sampled = static_cast<double>(SAMPLED_LEAVES) / particles.count();
  int number = 0;
  for (size_t g = 0; g < trees.size(); g++) {
    const Range group = particles.groups[g];
    if (group.empty()) continue;
    const int wanted = static_cast<int>(std::ceil(part_sampled * group.size()));
    const int taken = std::min(trees[g].leaves(), wanted);
    for (int k = 0; k < taken; k++)
      if (number++ % comm->nprocs == comm->me)
        sample.push_back(
            {static_cast<int>(g), part(trees[g].leaves(), 2 * k + 1, 2 * taken).begin});
  }
}

void AllPairsSum::find_sampled_forces()
{
  sampled_forces.clear(particles.count());
#pragma omp parallel for num_threads(comm->nthreads) if (comm->nthreads > 1) schedule(dynamic)
  for (size_t k = 0; k < sample.size(); k++) {
    const int g = sample[k].group;
    const Range targets = trees[g].particles_of_leaves(sample[k].leaf, sample[k].leaf + 1);
    sum_among(field_between(g, g), particles.sources, targets, sampled_forces);
    for (size_t h = 0; h < particles.groups.size(); h++)
      for (const Range others : {Range{0, targets.begin}, Range{targets.end, particles.count()}})
        sum_from(field_between(g, h), particles.sources, targets, particles.sources,
                 common(others, particles.groups[h]), sampled_forces);
  }
}

// Climbs the ladder from the rung that served last until one is accurate enough, then down as long
// as the next one is as well.
bool AllPairsSum::find_cheapest_trial(Trial &found)
{
  const auto is_accurate = [this](const Trial &trial) {
    return trial.approximation.error <= PART_OF_ACCURACY * accuracy;
  };
  Trial trial = try_rung(rung);
  if (!is_accurate(trial)) {
    while (!is_accurate(trial)) {
      if (rung + 1 == RUNGS) return false;
      trial = try_rung(++rung);
    }
    found = trial;
    return true;
  }
  for (found = trial; rung > 0; found = trial, rung--) {
    trial = try_rung(rung - 1);
    if (!is_accurate(trial)) break;
  }
  return true;
}

AllPairsSum::Trial AllPairsSum::try_rung(int number)
{
  const Rung tried = LADDER[number];
  expansion = std::make_unique<CartesianExpansion>(tried.order);
  FieldForces approximate;
  approximate.clear(particles.count());
  SummationWork work;
  const int groups = static_cast<int>(trees.size());
  expand_trees();

  enum { ERROR_SQUARE, FORCE_SQUARE, NEAR, FAR, TARGETS, SUMS };
  double sums[SUMS] = {};
  for (const SampledLeaf &sampled : sample) {
    const NearFieldTree &tree = trees[sampled.group];
    const Range targets = tree.particles_of_leaves(sampled.leaf, sampled.leaf + 1);
    for (int h = 0; h < groups; h++) {
      if (particles.groups[h].empty()) continue;
      const TreeSummation sum{field_between(sampled.group, h), *expansion, tried.opening, 1,
                              particles.sources};
      sum(tree, targets, trees[h], approximate, nullptr, work);
    }
    for (int k = targets.begin; k < targets.end; k++) {
      const Vector3 exact(sampled_forces.x[k], sampled_forces.y[k], sampled_forces.z[k]);
      const Vector3 error = Vector3(approximate.x[k], approximate.y[k], approximate.z[k]) - exact;
      const double factor = particles.sources.factor[k], square = factor * factor;
      sums[ERROR_SQUARE] += square * dot(error, error);
      sums[FORCE_SQUARE] += square * dot(exact, exact);
    }
    sums[TARGETS] += targets.size();
  }
  sums[NEAR] = work.near;
  sums[FAR] = work.far;
  MPI_Allreduce(MPI_IN_PLACE, sums, SUMS, MPI_DOUBLE, MPI_SUM, world);
  MPI_Bcast(sums, SUMS, MPI_DOUBLE, 0, world);

  const double terms = CartesianExpansion::count_up_to(tried.order) *
                       ((tried.order + 4.0) * (tried.order + 5.0) * (tried.order + 6.0) / 120.0);
  const double cost_on_sample = sums[NEAR] + sums[FAR] * (CELL_COST + CELL_COST_OF_TERM * terms);
  const double whole = particles.count();
  Trial trial;
  const double error =
      sums[ERROR_SQUARE] == 0.0 ? 0.0 : std::sqrt(sums[ERROR_SQUARE] / sums[FORCE_SQUARE]);
  trial.approximation = {tried.order, tried.opening, error};
  trial.cost =
      whole * (cost_on_sample / sums[TARGETS] + PARTICLE_COST_OF_COEFFICIENT * expansion->count);
  return trial;
}

double AllPairsSum::cost_of_direct_sum() const
{
  const double all = particles.count();
  return MUTUAL_COST * all * all;
}

// Takes a way to sum from here on, and says so where it is not the one before; returns whether it
// is news.
bool AllPairsSum::use(const Approximation &chosen, double cost)
{
  const bool is_news =
      chosen.order != used.order || chosen.opening != used.opening || !is_announced;
  is_announced = true;
  used = chosen;
  if (used.order > 0)
    expansion = std::make_unique<CartesianExpansion>(used.order);
  else
    trees.clear();
  if (comm->me != 0 || !is_news) return is_news;
  utils::logmesg(lmp, "Near field at step {}: ", update->ntimestep);
  if (used.order == 0)
    utils::logmesg(lmp, "direct sum over all pairs\n");
  else
    utils::logmesg(lmp,
                   "tree of order {}, opening {:g}, error {:.2g} of the force (asked: {:g}), "
                   "work {:.2g} of the direct sum's\n",
                   used.order, used.opening, used.error, accuracy, cost / cost_of_direct_sum());
  return is_news;
}

double AllPairsSum::memory_usage() const
{
  double bytes = particles.memory_usage();
  for (const NearFieldTree &tree : trees) bytes += tree.memory_usage();
  for (const FieldForces *found : {&forces, &sampled_forces})
    bytes += 3.0 * sizeof(double) * found->x.capacity();
  return bytes + sizeof(double) * potentials.capacity();
}
