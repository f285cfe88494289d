#include "gathered_particles.h"

#include "atom.h"
#include "comm.h"

#include <numeric>

using namespace LAMMPS_NS;

// Collects numbers of all ranks, `each` per particle, in the order of ranks.
template <class Number>
std::vector<Number> GatheredParticles::gathered(const std::vector<Number> &ours, int each,
                                                MPI_Datatype datatype) const
{
  std::vector<int> counts_of_numbers(counts), offsets_of_numbers(offsets);
  for (int &number : counts_of_numbers) number *= each;
  for (int &number : offsets_of_numbers) number *= each;
  std::vector<Number> all(place.size() * each);
  MPI_Allgatherv(ours.data(), static_cast<int>(ours.size()), datatype, all.data(),
                 counts_of_numbers.data(), offsets_of_numbers.data(), datatype, world);
  return all;
}

void GatheredParticles::arrange(const std::vector<int> &group_of_type, int group_count)
{
  const int ours = atom->nlocal;
  counts.resize(comm->nprocs);
  MPI_Allgather(&ours, 1, MPI_INT, counts.data(), 1, MPI_INT, world);
  offsets.assign(comm->nprocs, 0);
  std::partial_sum(counts.begin(), counts.end() - 1, offsets.begin() + 1);
  const size_t all = offsets.back() + counts.back();
  place.resize(all);
  tag.resize(all);
  sources.resize(all);

  std::vector<int> own_groups(ours);
  for (int i = 0; i < ours; i++) own_groups[i] = group_of_type[atom->type[i]];
  const std::vector<int> group = gathered(own_groups, 1, MPI_INT);
  std::vector<int> next(group_count + 1, 0);
  for (const int g : group) next[g + 1]++;
  std::partial_sum(next.begin(), next.end(), next.begin());
  groups.resize(group_count);
  for (int g = 0; g < group_count; g++) groups[g] = {next[g], next[g + 1]};
  for (size_t k = 0; k < all; k++) place[k] = next[group[k]]++;

  const std::vector<tagint> tags =
      gathered(std::vector<tagint>(atom->tag, atom->tag + ours), 1, MPI_LMP_TAGINT);
  for (size_t k = 0; k < all; k++) tag[place[k]] = tags[k];
  find_own_places();
}

void GatheredParticles::find_own_places()
{
  const auto first = place.begin() + offsets[comm->me];
  own_place.assign(first, first + counts[comm->me]);
}

void GatheredParticles::gather(const std::vector<double> &factors)
{
  constexpr int each = 4; // position and factor
  std::vector<double> ours;
  ours.reserve(each * own_place.size());
  for (size_t i = 0; i < own_place.size(); i++)
    ours.insert(ours.end(), {atom->x[i][0], atom->x[i][1], atom->x[i][2], factors[i]});
  const std::vector<double> all = gathered(ours, each, MPI_DOUBLE);
  for (size_t k = 0; k < place.size(); k++)
    sources.set(place[k], &all[each * k], all[each * k + 3]);
}

void GatheredParticles::reorder(int first, const std::vector<int> &order)
{
  const auto move = [first, &order](auto &column) {
    auto moved = column;
    for (size_t k = 0; k < order.size(); k++) moved[first + k] = column[order[k]];
    column.swap(moved);
  };
  for (auto *column : {&sources.x, &sources.y, &sources.z, &sources.factor}) move(*column);
  move(tag);
  std::vector<int> moved_to(place.size());
  std::iota(moved_to.begin(), moved_to.end(), 0);
  for (size_t k = 0; k < order.size(); k++) moved_to[order[k]] = first + static_cast<int>(k);
  for (int &at : place) at = moved_to[at];
  find_own_places();
}

void GatheredParticles::add_up_ranks(std::vector<double> &column) const
{
  if (comm->nprocs > 1)
    MPI_Allreduce(MPI_IN_PLACE, column.data(), static_cast<int>(column.size()), MPI_DOUBLE, MPI_SUM,
                  world);
}

double GatheredParticles::memory_usage() const
{
  return place.capacity() * (2.0 * sizeof(int) + sizeof(tagint) + 4.0 * sizeof(double));
}
