#include "fix_blast_bonds.h"

#include "atom.h"
#include "error.h"

#include <algorithm>
#include <mpi.h>

using namespace LAMMPS_NS;
using namespace FixConst;

FixBlastBonds::FixBlastBonds(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg)
{
  if (narg != 3) error->all(FLERR, "Fix BLAST/BONDS takes no arguments");
  restart_peratom = 1;
  create_attribute = 1;
  maxexchange_dynamic = 1;
  maxexchange = 1;
  grow_arrays(atom->nmax);
  atom->add_callback(Atom::GROW);
  atom->add_callback(Atom::RESTART);
}

FixBlastBonds::~FixBlastBonds()
{
  atom->delete_callback(id, Atom::GROW);
  atom->delete_callback(id, Atom::RESTART);
}

int FixBlastBonds::setmask()
{
  return PRE_EXCHANGE;
}

static bool contains(const std::vector<tagint> &list, tagint partner)
{
  return std::find(list.begin(), list.end(), partner) != list.end();
}

bool FixBlastBonds::has(int i, tagint partner) const
{
  return contains(partners[i], partner);
}

bool FixBlastBonds::had(int i, tagint partner) const
{
  return has(i, partner) || (!doubtful.empty() && contains(doubtful[i], partner));
}

void FixBlastBonds::begin_review()
{
  doubtful.resize(partners.size());
  std::swap(partners, doubtful);
}

void FixBlastBonds::end_review()
{
  for (auto &list : doubtful) list.clear();
}

void FixBlastBonds::form(int i, tagint partner)
{
  if (!has(i, partner)) partners[i].push_back(partner);
}

void FixBlastBonds::forget(int i, tagint partner)
{
  auto &list = partners[i];
  list.erase(std::remove(list.begin(), list.end(), partner), list.end());
}

int FixBlastBonds::most_partners() const
{
  size_t most = 0;
  for (int i = 0; i < atom->nlocal; i++) most = std::max(most, partners[i].size());
  return static_cast<int>(most);
}

void FixBlastBonds::pre_exchange()
{
  maxexchange = 1 + most_partners();
}

void FixBlastBonds::grow_arrays(int nmax)
{
  partners.resize(nmax);
}

void FixBlastBonds::copy_arrays(int i, int j, int /*delflag*/)
{
  partners[j] = partners[i];
}

void FixBlastBonds::set_arrays(int i)
{
  partners[i].clear();
}

int FixBlastBonds::pack_exchange(int i, double *buffer)
{
  int m = 0;
  buffer[m++] = static_cast<double>(partners[i].size());
  for (const tagint partner : partners[i]) buffer[m++] = ubuf(partner).d;
  return m;
}

int FixBlastBonds::unpack_exchange(int i, double *buffer)
{
  int m = 0;
  const int count = static_cast<int>(buffer[m++]);
  partners[i].resize(count);
  for (tagint &partner : partners[i]) partner = static_cast<tagint>(ubuf(buffer[m++]).i);
  return m;
}

int FixBlastBonds::pack_restart(int i, double *buffer)
{
  buffer[0] = size_restart(i);
  return 1 + pack_exchange(i, buffer + 1);
}

void FixBlastBonds::unpack_restart(int i, int nth)
{
  // The values of each fix begin with their number.
  double *extra = atom->extra[i];
  int first = 0;
  for (int fix = 0; fix < nth; fix++) first += static_cast<int>(extra[first]);
  unpack_exchange(i, extra + first + 1);
}

int FixBlastBonds::size_restart(int i)
{
  return 2 + static_cast<int>(partners[i].size());
}

int FixBlastBonds::maxsize_restart()
{
  int most = most_partners(), most_everywhere = 0;
  MPI_Allreduce(&most, &most_everywhere, 1, MPI_INT, MPI_MAX, world);
  return 2 + most_everywhere;
}

double FixBlastBonds::memory_usage()
{
  double bytes = static_cast<double>(partners.capacity() * sizeof(partners[0]));
  for (const auto &list : partners) bytes += static_cast<double>(list.capacity() * sizeof(tagint));
  return bytes;
}
