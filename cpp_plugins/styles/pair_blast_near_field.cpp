#include "pair_blast_near_field.h"

#include "simulated_time.h"
#include "style_arguments.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "force.h"
#include "memory.h"
#include "neigh_list.h"
#include "neighbor.h"
#include "update.h"
#include "utils.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <numeric>

using namespace LAMMPS_NS;
using blast::NearField;
using blast::Scaling;
using blast::Vector3;

static constexpr char STYLE[] = "Pair blast/nearfield";

PairBlastNearField::PairBlastNearField(LAMMPS *lmp) : Pair(lmp)
{
  restartinfo = 1;
  single_enable = 1;
}

PairBlastNearField::~PairBlastNearField()
{
  if (copymode || !allocated) return;
  memory->destroy(setflag);
  memory->destroy(cutsq);
}

void PairBlastNearField::allocate()
{
  allocated = 1;
  types = atom->ntypes;
  memory->create(setflag, types + 1, types + 1, "pair:setflag");
  memory->create(cutsq, types + 1, types + 1, "pair:cutsq");
  for (int i = 0; i <= types; i++)
    for (int j = 0; j <= types; j++) setflag[i][j] = 0;
  fields.assign((types + 1) * (types + 1), NearField());
}

void PairBlastNearField::settings(int narg, char **arg)
{
  if (narg < 2) utils::missing_cmd_args(FLERR, "pair_style blast/nearfield", error);
  all_pairs = strcmp(arg[0], "all") == 0;
  cutoff = all_pairs ? 0.0 : positive_argument(lmp, STYLE, "cutoff", arg[0]);
  no_virial_fdotr_compute = all_pairs ? 1 : 0;

  if (strcmp(arg[1], "mass") == 0)
    scaling = Scaling::mass;
  else if (strcmp(arg[1], "area") == 0)
    scaling = Scaling::area;
  else if (strcmp(arg[1], "volume") == 0)
    scaling = Scaling::volume;
  else if (strcmp(arg[1], "charge") == 0)
    scaling = Scaling::charge;
  else
    error->all(FLERR, "Unknown {} scaling: {} (mass, area, volume or charge)", STYLE, arg[1]);

  switch_width = 0.0;
  signs.clear();
  for (int iarg = 2; iarg < narg; iarg += 2) {
    require_arguments(lmp, STYLE, iarg, 1, narg, arg);
    if (strcmp(arg[iarg], "switch") == 0) {
      switch_width = positive_argument(lmp, STYLE, "switch", arg[iarg + 1]);
    } else if (strcmp(arg[iarg], "signs") == 0) {
      signs = arg[iarg + 1];
      if (!utils::strmatch(signs, "^i_."))
        error->all(FLERR, "{} signs must name an integer property i_NAME: {}", STYLE, signs);
    } else {
      error->all(FLERR, "Unknown {} keyword: {}", STYLE, arg[iarg]);
    }
  }
  if (switch_width > 0.0 && (all_pairs || switch_width >= cutoff))
    error->all(FLERR, "{} switch must be narrower than a cutoff", STYLE);
  if (!signs.empty() && scaling == Scaling::charge)
    error->all(FLERR, "{} with scaling charge takes signs from the charges", STYLE);

  // Settings given anew hold for the coefficients given before.
  for (NearField &given : fields) {
    given.cutoff = cutoff;
    given.switch_width = switch_width;
  }
}

void PairBlastNearField::coeff(int narg, char **arg)
{
  if (narg < 6) utils::missing_cmd_args(FLERR, "pair_coeff", error);
  if (narg > 7 || (narg == 7 && all_pairs))
    error->all(FLERR, "{} takes no pair coefficient {}", STYLE, arg[narg - 1]);
  if (!allocated) allocate();
  int ilo, ihi, jlo, jhi;
  utils::bounds(FLERR, arg[0], 1, types, ilo, ihi, error);
  utils::bounds(FLERR, arg[1], 1, types, jlo, jhi, error);

  NearField given;
  given.attraction = {finite_argument(lmp, STYLE, arg[2]),
                      non_negative_argument(lmp, STYLE, "attraction exponent", arg[3])};
  given.repulsion = {finite_argument(lmp, STYLE, arg[4]),
                     non_negative_argument(lmp, STYLE, "repulsion exponent", arg[5])};
  given.cutoff = narg == 7 ? positive_argument(lmp, STYLE, "cutoff", arg[6]) : cutoff;
  given.switch_width = switch_width;
  if (switch_width > 0.0 && switch_width >= given.cutoff)
    error->all(FLERR, "{} switch must be narrower than a cutoff", STYLE);

  int count = 0;
  for (int i = ilo; i <= ihi; i++)
    for (int j = std::max(jlo, i); j <= jhi; j++) {
      field(i, j) = field(j, i) = given;
      setflag[i][j] = 1;
      count++;
    }
  if (count == 0) error->all(FLERR, "Incorrect args for pair coefficients");
}

void PairBlastNearField::init_style()
{
  if (strcmp(update->unit_style, "si") != 0) error->all(FLERR, "{} requires units si", STYLE);
  if (scaling == Scaling::mass && !atom->rmass_flag)
    error->all(FLERR, "{} with scaling mass requires atom attribute rmass", STYLE);
  if ((scaling == Scaling::area || scaling == Scaling::volume) && !atom->radius_flag)
    error->all(FLERR, "{} with this scaling requires atom attribute radius", STYLE);
  if (scaling == Scaling::charge && !atom->q_flag)
    error->all(FLERR, "{} with scaling charge requires atom attribute q", STYLE);
  if (!signs.empty()) {
    int is_number, columns, on_ghosts;
    const int index = atom->find_custom_ghost(signs.c_str() + 2, is_number, columns, on_ghosts);
    if (index < 0 || is_number || columns)
      error->all(FLERR, "{}: there is no integer atom property {}", STYLE, signs);
    if (!on_ghosts && !all_pairs)
      error->all(FLERR, "{}: fix property/atom of {} needs: ghost yes", STYLE, signs);
  }
  if (!all_pairs) {
    neighbor->add_request(this);
  } else if (domain->xperiodic || domain->yperiodic || domain->zperiodic) {
    error->all(FLERR, "{} all requires boundaries that are not periodic", STYLE);
  }
}

double PairBlastNearField::init_one(int i, int j)
{
  if (!setflag[i][j])
    error->all(FLERR, "{} does not mix: give a pair_coeff for types {} and {}", STYLE, i, j);
  field(j, i) = field(i, j);
  return field(i, j).cutoff;
}

void PairBlastNearField::compute(int eflag, int vflag)
{
  ev_init(eflag, vflag);
  work_out_factors();
  if (all_pairs)
    compute_all_pairs();
  else
    compute_by_list();
}

void PairBlastNearField::work_out_factors()
{
  const int count = all_pairs ? atom->nlocal : atom->nlocal + atom->nghost;
  const int *sign = sign_property();
  factors.resize(count);
  for (int i = 0; i < count; i++) factors[i] = factor_of(i, sign);
}

// The signs c of eq. 7.23 by local index, or nullptr where all are positive.
const int *PairBlastNearField::sign_property() const
{
  if (signs.empty()) return nullptr;
  int is_number, columns;
  return atom->ivector[atom->find_custom(signs.c_str() + 2, is_number, columns)];
}

double PairBlastNearField::factor_of(int i, const int *sign) const
{
  if (sign && sign[i] != 1 && sign[i] != -1)
    error->one(FLERR, "{}: property {} of atom {} is neither 1 nor -1", STYLE, signs, atom->tag[i]);
  return blast::near_field_factor(scaling, atom->rmass_flag ? atom->rmass[i] : 0.0,
                                  atom->radius_flag ? atom->radius[i] : 0.0,
                                  atom->q_flag ? atom->q[i] : 0.0, sign ? sign[i] : 1.0);
}

void PairBlastNearField::compute_by_list()
{
  double **x = atom->x, **f = atom->f;
  const int *type = atom->type;
  const int nlocal = atom->nlocal, newton_pair = force->newton_pair;

  for (int ii = 0; ii < list->inum; ii++) {
    const int i = list->ilist[ii];
    const Vector3 position(x[i]);
    const NearField *fields_of_i = &field(type[i], 0);
    const double *squares_of_i = cutsq[type[i]];
    const int *neighbours = list->firstneigh[i];
    Vector3 sum;
    for (int jj = 0; jj < list->numneigh[i]; jj++) {
      const int j = neighbours[jj] & NEIGHMASK;
      const Vector3 offset = Vector3(x[j]) - position;
      const double square = dot(offset, offset);
      if (square >= squares_of_i[type[j]]) continue;
      if (square == 0.0) stop_at_coincidence(atom->tag[i], atom->tag[j]);
      const NearField &between = fields_of_i[type[j]];
      const double inverse = 1.0 / std::sqrt(square), distance = square * inverse;
      const double both = factors[i] * factors[j];
      const double per_offset = both * inverse * near_field_force(between, distance, inverse);
      sum += per_offset * offset;
      if (newton_pair || j < nlocal) (Vector3(f[j]) - per_offset * offset).store(f[j]);
      if (evflag) {
        const double energy = eflag_either ? both * near_field_energy(between, distance) : 0.0;
        ev_tally(i, j, nlocal, newton_pair, energy, 0.0, -per_offset, -offset.x, -offset.y,
                 -offset.z);
      }
    }
    (Vector3(f[i]) + sum).store(f[i]);
  }
  if (vflag_fdotr) virial_fdotr_compute();
}

void PairBlastNearField::compute_all_pairs()
{
  if (neighbor->ago == 0) arrange_everyone();
  gather_everyone();
  forces.clear(everyone.place.size());
  if (sum_share() == 0.0) find_coincidence();
  collect_forces();

  int n = 0;
  for (int t = 1; t <= types; t++)
    for (int k = everyone.own_of_type[t].begin; k < everyone.own_of_type[t].end; k++) {
      const int i = everyone.own[n++];
      const Vector3 per_factor(forces.x[k], forces.y[k], forces.z[k]);
      (Vector3(atom->f[i]) + factors[i] * per_factor).store(atom->f[i]);
    }
  if (evflag) tally_all_pairs();
}

// Collects numbers of all ranks, `each` per particle, in the order of ranks.
template <class Number>
std::vector<Number> PairBlastNearField::gathered(const std::vector<Number> &ours, int each,
                                                 MPI_Datatype datatype) const
{
  std::vector<int> counts(everyone.counts), offsets(everyone.offsets);
  for (int &count : counts) count *= each;
  for (int &offset : offsets) offset *= each;
  std::vector<Number> all(everyone.place.size() * each);
  MPI_Allgatherv(ours.data(), static_cast<int>(ours.size()), datatype, all.data(), counts.data(),
                 offsets.data(), datatype, world);
  return all;
}

// Settles who is where among the particles of all ranks, as long as none changes ranks.
void PairBlastNearField::arrange_everyone()
{
  Everyone &all = everyone;
  all.own.resize(atom->nlocal);
  std::iota(all.own.begin(), all.own.end(), 0);
  std::stable_sort(all.own.begin(), all.own.end(),
                   [this](int i, int j) { return atom->type[i] < atom->type[j]; });

  std::vector<int> ours(types + 1, 0), by_rank((types + 1) * comm->nprocs);
  for (const int i : all.own) ours[atom->type[i]]++;
  MPI_Allgather(ours.data(), types + 1, MPI_INT, by_rank.data(), types + 1, MPI_INT, world);

  all.counts.assign(comm->nprocs, 0);
  all.offsets.assign(comm->nprocs, 0);
  for (int rank = 0; rank < comm->nprocs; rank++) {
    if (rank > 0) all.offsets[rank] = all.offsets[rank - 1] + all.counts[rank - 1];
    const int *first = &by_rank[rank * (types + 1)];
    all.counts[rank] = std::accumulate(first, first + types + 1, 0);
  }
  all.place.resize(all.offsets.back() + all.counts.back());

  all.of_type.assign(types + 1, {0, 0});
  all.own_of_type.assign(types + 1, {0, 0});
  std::vector<int> next = all.offsets; // by rank, the next of its particles in the gathered list
  int place = 0;
  for (int t = 1; t <= types; t++) {
    all.of_type[t].begin = place;
    for (int rank = 0; rank < comm->nprocs; rank++) {
      const int count = by_rank[rank * (types + 1) + t];
      if (rank == comm->me) all.own_of_type[t] = {place, place + count};
      for (int k = 0; k < count; k++) all.place[next[rank]++] = place++;
    }
    all.of_type[t].end = place;
  }

  std::vector<tagint> own_tags;
  for (const int i : all.own) own_tags.push_back(atom->tag[i]);
  const std::vector<tagint> tags = gathered(own_tags, 1, MPI_LMP_TAGINT);
  all.tag.resize(tags.size());
  for (size_t g = 0; g < tags.size(); g++) all.tag[all.place[g]] = tags[g];
  all.sources.resize(tags.size());
  all.share = share_of(comm->me);
}

// Equal shares of all particles: however they lie on the ranks, the ranks have the same work.
Range PairBlastNearField::share_of(int rank) const
{
  const bigint count = static_cast<bigint>(everyone.place.size());
  return {static_cast<int>(count * rank / comm->nprocs),
          static_cast<int>(count * (rank + 1) / comm->nprocs)};
}

void PairBlastNearField::gather_everyone()
{
  constexpr int each = 4; // position and factor
  std::vector<double> ours;
  ours.reserve(each * everyone.own.size());
  for (const int i : everyone.own)
    ours.insert(ours.end(), {atom->x[i][0], atom->x[i][1], atom->x[i][2], factors[i]});
  const std::vector<double> all = gathered(ours, each, MPI_DOUBLE);
  for (size_t g = 0; g < everyone.place.size(); g++)
    everyone.sources.set(everyone.place[g], &all[each * g], all[each * g + 3]);
}

// Sums the forces on the particles of our share; returns the smallest square of a distance.
double PairBlastNearField::sum_share()
{
  double nearest = INFINITY;
  const FieldSources &all = everyone.sources;
  for (int t = 1; t <= types; t++) {
    const Range of_type = everyone.of_type[t];
    const Range targets{std::max(of_type.begin, everyone.share.begin),
                        std::min(of_type.end, everyone.share.end)};
    if (targets.begin >= targets.end) continue;
    nearest = std::fmin(nearest, sum_among(field(t, t), all, targets, forces));
    for (int u = 1; u <= types; u++) {
      const Range others = everyone.of_type[u];
      // All of another type; of the same type those before and after our share.
      const Range before{others.begin, t == u ? targets.begin : others.end};
      const Range after{t == u ? targets.end : others.end, others.end};
      for (const Range range : {before, after})
        nearest = std::fmin(nearest, sum_from(field(t, u), all, targets, all, range, forces));
    }
  }
  return nearest;
}

// Brings the forces of all shares together.
void PairBlastNearField::collect_forces()
{
  if (comm->nprocs == 1) return;
  std::vector<int> counts, offsets;
  for (int rank = 0; rank < comm->nprocs; rank++) {
    const Range share = share_of(rank);
    offsets.push_back(share.begin);
    counts.push_back(share.end - share.begin);
  }
  for (auto *column : {&forces.x, &forces.y, &forces.z})
    MPI_Allgatherv(MPI_IN_PLACE, 0, MPI_DATATYPE_NULL, column->data(), counts.data(),
                   offsets.data(), MPI_DOUBLE, world);
}

// Energy and virial, which few steps ask for. A pair of ours is met once; one with a particle of
// another rank is met by both ranks, and counts half on each.
void PairBlastNearField::tally_all_pairs()
{
  const FieldSources &all = everyone.sources;
  const auto local_index = [this](int type, int place, int first) {
    return everyone.own[first + place - everyone.own_of_type[type].begin];
  };
  int first_of_t = 0;
  for (int t = 1; t <= types; t++) {
    const Range own = everyone.own_of_type[t];
    int first_of_u = 0;
    for (int u = 1; u <= types; u++) {
      const Range own_u = everyone.own_of_type[u];
      for (int i = own.begin; i < own.end; i++)
        for (int k = everyone.of_type[u].begin; k < everyone.of_type[u].end; k++) {
          const bool is_ours = k >= own_u.begin && k < own_u.end;
          if (is_ours && k <= i) continue;
          const Vector3 offset(all.x[k] - all.x[i], all.y[k] - all.y[i], all.z[k] - all.z[i]);
          const double distance = norm(offset), both = all.factor[i] * all.factor[k];
          const double energy =
              eflag_either ? both * near_field_energy(field(t, u), distance) : 0.0;
          const double fpair = -both * near_field_force(field(t, u), distance) / distance;
          const int local_i = local_index(t, i, first_of_t);
          if (is_ours)
            ev_tally(local_i, local_index(u, k, first_of_u), atom->nlocal, 1, energy, 0.0, fpair,
                     -offset.x, -offset.y, -offset.z);
          else
            ev_tally_full(local_i, energy, 0.0, fpair, -offset.x, -offset.y, -offset.z);
        }
      first_of_u += own_u.end - own_u.begin;
    }
    first_of_t += own.end - own.begin;
  }
}

double PairBlastNearField::single(int i, int j, int itype, int jtype, double square,
                                  double /*factor_coul*/, double /*factor_lj*/, double &fforce)
{
  const NearField &between = field(itype, jtype);
  const double distance = std::sqrt(square);
  const int *sign = sign_property();
  const double both = factor_of(i, sign) * factor_of(j, sign);
  fforce = -both * near_field_force(between, distance) / distance;
  return both * near_field_energy(between, distance);
}

void PairBlastNearField::stop_at_coincidence(tagint first, tagint second)
{
  error->one(FLERR, "{}: the centres of atoms {} and {} coincide at time {:.10g}", STYLE, first,
             second, simulated_time(*update));
}

void PairBlastNearField::find_coincidence()
{
  const FieldSources &all = everyone.sources;
  for (int i = everyone.share.begin; i < everyone.share.end; i++)
    for (size_t k = 0; k < all.x.size(); k++)
      if (static_cast<int>(k) != i && all.x[k] == all.x[i] && all.y[k] == all.y[i] &&
          all.z[k] == all.z[i])
        stop_at_coincidence(everyone.tag[i], everyone.tag[k]);
  error->one(FLERR, "{}: two atoms are too close for their distance to be squared", STYLE);
}

void PairBlastNearField::write_restart_settings(FILE *fp)
{
  const int integers[] = {all_pairs ? 1 : 0, static_cast<int>(scaling),
                          static_cast<int>(signs.size())};
  const double numbers[] = {cutoff, switch_width};
  fwrite(integers, sizeof(integers), 1, fp);
  fwrite(numbers, sizeof(numbers), 1, fp);
  fwrite(signs.data(), 1, signs.size(), fp);
}

void PairBlastNearField::read_restart_settings(FILE *fp)
{
  int integers[3];
  double numbers[2];
  if (comm->me == 0) {
    utils::sfread(FLERR, integers, sizeof(integers), 1, fp, nullptr, error);
    utils::sfread(FLERR, numbers, sizeof(numbers), 1, fp, nullptr, error);
  }
  MPI_Bcast(integers, 3, MPI_INT, 0, world);
  MPI_Bcast(numbers, 2, MPI_DOUBLE, 0, world);
  signs.resize(integers[2]);
  if (comm->me == 0 && !signs.empty())
    utils::sfread(FLERR, &signs[0], 1, signs.size(), fp, nullptr, error);
  MPI_Bcast(&signs[0], integers[2], MPI_CHAR, 0, world);
  all_pairs = integers[0] == 1;
  no_virial_fdotr_compute = integers[0];
  scaling = static_cast<Scaling>(integers[1]);
  cutoff = numbers[0];
  switch_width = numbers[1];
}

void PairBlastNearField::write_restart(FILE *fp)
{
  write_restart_settings(fp);
  for (int i = 1; i <= types; i++)
    for (int j = i; j <= types; j++) {
      fwrite(&setflag[i][j], sizeof(int), 1, fp);
      if (!setflag[i][j]) continue;
      const NearField &a = field(i, j);
      const double numbers[] = {a.attraction.strength, a.attraction.power.exponent,
                                a.repulsion.strength, a.repulsion.power.exponent, a.cutoff};
      fwrite(numbers, sizeof(numbers), 1, fp);
    }
}

void PairBlastNearField::read_restart(FILE *fp)
{
  read_restart_settings(fp);
  allocate();
  for (int i = 1; i <= types; i++)
    for (int j = i; j <= types; j++) {
      double numbers[5];
      if (comm->me == 0) utils::sfread(FLERR, &setflag[i][j], sizeof(int), 1, fp, nullptr, error);
      MPI_Bcast(&setflag[i][j], 1, MPI_INT, 0, world);
      if (!setflag[i][j]) continue;
      if (comm->me == 0) utils::sfread(FLERR, numbers, sizeof(numbers), 1, fp, nullptr, error);
      MPI_Bcast(numbers, 5, MPI_DOUBLE, 0, world);
      NearField a;
      a.attraction = {numbers[0], numbers[1]};
      a.repulsion = {numbers[2], numbers[3]};
      a.cutoff = numbers[4];
      a.switch_width = switch_width;
      field(i, j) = field(j, i) = a;
    }
}

double PairBlastNearField::memory_usage()
{
  const double per_particle = 8.0 * sizeof(double) + sizeof(int) + sizeof(tagint);
  return Pair::memory_usage() + factors.capacity() * sizeof(double) +
         everyone.place.capacity() * per_particle;
}
