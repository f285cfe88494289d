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
#include <tuple>

using namespace LAMMPS_NS;
using blast::NearField;
using blast::Scaling;
using blast::Vector3;

static constexpr char STYLE[] = "Pair blast/nearfield";

// What compute pair gives beside the energy.
enum { ERROR, ORDER, OPENING, APPROXIMATION_NUMBERS };

PairBlastNearField::PairBlastNearField(LAMMPS *lmp) : Pair(lmp)
{
  restartinfo = 1;
  single_enable = 1;
  nextra = APPROXIMATION_NUMBERS;
  pvector = new double[nextra]();
}

PairBlastNearField::~PairBlastNearField()
{
  delete[] pvector;
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

  switch_width = accuracy = 0.0;
  std::fill(pvector, pvector + APPROXIMATION_NUMBERS, 0.0);
  method = SummationMethod::direct;
  signs.clear();
  for (int iarg = 2; iarg < narg; iarg += 2) {
    require_arguments(lmp, STYLE, iarg, 1, narg, arg);
    const char *value = arg[iarg + 1];
    if (strcmp(arg[iarg], "switch") == 0) {
      switch_width = positive_argument(lmp, STYLE, "switch", value);
    } else if (strcmp(arg[iarg], "signs") == 0) {
      signs = value;
      if (!utils::strmatch(signs, "^i_."))
        error->all(FLERR, "{} signs must name an integer property i_NAME: {}", STYLE, signs);
    } else if (strcmp(arg[iarg], "method") == 0) {
      method = method_argument(value);
    } else if (strcmp(arg[iarg], "accuracy") == 0) {
      accuracy = positive_argument(lmp, STYLE, "accuracy", value);
    } else {
      error->all(FLERR, "Unknown {} keyword: {}", STYLE, arg[iarg]);
    }
  }
  if (switch_width > 0.0 && (all_pairs || switch_width >= cutoff))
    error->all(FLERR, "{} switch must be narrower than a cutoff", STYLE);
  if (!signs.empty() && scaling == Scaling::charge)
    error->all(FLERR, "{} with scaling charge takes signs from the charges", STYLE);
  const bool is_direct = method == SummationMethod::direct;
  if (!all_pairs && (!is_direct || accuracy > 0.0))
    error->all(FLERR, "{} method and accuracy go with `all` only", STYLE);
  if (is_direct != (accuracy == 0.0))
    error->all(FLERR, "{} methods tree and auto need an accuracy, direct has none", STYLE);
  if (accuracy >= 1.0) error->all(FLERR, "{} accuracy must be less than 1: {}", STYLE, accuracy);
  set_up_sum();

  // Settings given anew hold for the coefficients given before.
  for (NearField &given : fields) {
    given.cutoff = cutoff;
    given.switch_width = switch_width;
  }
}

SummationMethod PairBlastNearField::method_argument(const char *word) const
{
  if (strcmp(word, "direct") == 0) return SummationMethod::direct;
  if (strcmp(word, "tree") == 0) return SummationMethod::tree;
  if (strcmp(word, "auto") == 0) return SummationMethod::automatic;
  error->all(FLERR, "Unknown {} method: {} (direct, tree or auto)", STYLE, word);
  return SummationMethod::direct;
}

void PairBlastNearField::set_up_sum()
{
  sum.reset();
  if (all_pairs)
    sum = std::make_unique<AllPairsSum>(
        lmp, method, accuracy, [this](int itype, int jtype) -> const NearField & {
          static const NearField none;
          return is_ours[itype * (types + 1) + jtype] ? field(itype, jtype) : none;
        });
}

void PairBlastNearField::coeff(int narg, char **arg)
{
  if (narg < 6) utils::missing_cmd_args(FLERR, "pair_coeff", error);
  if (narg > 7 || (narg == 7 && all_pairs))
    error->all(FLERR, "{} takes no pair coefficient {}", STYLE, arg[narg - 1]);
  if (!allocated) allocate();
  int ilo, ihi, jlo, jhi;
  type_range(lmp, STYLE, arg[0], types, ilo, ihi);
  type_range(lmp, STYLE, arg[1], types, jlo, jhi);

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
  is_ours.assign((types + 1) * (types + 1), 0);
  if (sum) sum->forget_choice();
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
  is_ours[i * (types + 1) + j] = is_ours[j * (types + 1) + i] = 1;
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
  if (sum->compute(factors, eflag_either)) find_coincidence();
  for (int i = 0; i < atom->nlocal; i++)
    (Vector3(atom->f[i]) + factors[i] * sum->force_on(i)).store(atom->f[i]);
  if (comm->me == 0) report_approximation();
  if (vflag_atom || cvflag_atom || num_tally_compute > 0)
    tally_pair_by_pair();
  else
    tally_all_pairs();
}

// Compute pair adds up the numbers of all ranks.
void PairBlastNearField::report_approximation()
{
  const AllPairsSum::Approximation &used = sum->approximation();
  pvector[ERROR] = used.error;
  pvector[ORDER] = used.order;
  pvector[OPENING] = used.opening;
}

// Half the energy of every pair belongs to each of its particles. The virial of forces between
// pairs is that of the sums on the particles.
void PairBlastNearField::tally_all_pairs()
{
  for (int i = 0; i < atom->nlocal; i++) {
    if (eflag_either) {
      const double energy = 0.5 * factors[i] * sum->potential_of(i);
      if (eflag_global) eng_vdwl += energy;
      if (eflag_atom) eatom[i] += energy;
    }
    if (vflag_global) {
      const Vector3 force = factors[i] * sum->force_on(i);
      const double *x = atom->x[i];
      const double products[] = {x[0] * force.x, x[1] * force.y, x[2] * force.z,
                                 x[0] * force.y, x[0] * force.z, x[1] * force.z};
      for (int k = 0; k < 6; k++) virial[k] += products[k];
    }
  }
}

// What sums cannot give, which few steps ask for. A pair of ours is met once; one with a particle
// of another rank is met by both ranks, and counts half on each.
void PairBlastNearField::tally_pair_by_pair()
{
  const GatheredParticles &everyone = sum->everyone();
  const FieldSources &all = everyone.sources;
  std::vector<int> local_index(everyone.count(), -1);
  for (int i = 0; i < atom->nlocal; i++) local_index[everyone.own_place[i]] = i;

  for (int i = 0; i < atom->nlocal; i++) {
    const int at = everyone.own_place[i];
    for (size_t group = 0; group < everyone.groups.size(); group++) {
      const NearField &between = sum->field_on(atom->type[i], static_cast<int>(group));
      for (int k = everyone.groups[group].begin; k < everyone.groups[group].end; k++) {
        const int j = local_index[k];
        if (j >= 0 && j <= i) continue;
        const Vector3 offset(all.x[k] - all.x[at], all.y[k] - all.y[at], all.z[k] - all.z[at]);
        const double distance = norm(offset), both = all.factor[at] * all.factor[k];
        const double energy = eflag_either ? both * near_field_energy(between, distance) : 0.0;
        const double fpair = -both * near_field_force(between, distance) / distance;
        if (j >= 0)
          ev_tally(i, j, atom->nlocal, 1, energy, 0.0, fpair, -offset.x, -offset.y, -offset.z);
        else
          ev_tally_full(i, energy, 0.0, fpair, -offset.x, -offset.y, -offset.z);
      }
    }
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
  const GatheredParticles &everyone = sum->everyone();
  const FieldSources &all = everyone.sources;
  const auto key = [&all](int k) { return std::make_tuple(all.x[k], all.y[k], all.z[k]); };
  std::vector<int> sorted(everyone.count());
  std::iota(sorted.begin(), sorted.end(), 0);
  std::sort(sorted.begin(), sorted.end(), [&key](int a, int b) { return key(a) < key(b); });
  for (size_t k = 1; k < sorted.size(); k++)
    if (key(sorted[k - 1]) == key(sorted[k]))
      stop_at_coincidence(everyone.tag[sorted[k - 1]], everyone.tag[sorted[k]]);
  error->one(FLERR, "{}: two atoms are too close for their distance to be squared", STYLE);
}

void PairBlastNearField::write_restart_settings(FILE *fp)
{
  const int integers[] = {all_pairs ? 1 : 0, static_cast<int>(scaling), static_cast<int>(method),
                          static_cast<int>(signs.size())};
  const double numbers[] = {cutoff, switch_width, accuracy};
  fwrite(integers, sizeof(integers), 1, fp);
  fwrite(numbers, sizeof(numbers), 1, fp);
  fwrite(signs.data(), 1, signs.size(), fp);
}

void PairBlastNearField::read_restart_settings(FILE *fp)
{
  int integers[4];
  double numbers[3];
  if (comm->me == 0) {
    utils::sfread(FLERR, integers, sizeof(integers), 1, fp, nullptr, error);
    utils::sfread(FLERR, numbers, sizeof(numbers), 1, fp, nullptr, error);
  }
  MPI_Bcast(integers, 4, MPI_INT, 0, world);
  MPI_Bcast(numbers, 3, MPI_DOUBLE, 0, world);
  signs.resize(integers[3]);
  if (comm->me == 0 && !signs.empty())
    utils::sfread(FLERR, &signs[0], 1, signs.size(), fp, nullptr, error);
  MPI_Bcast(&signs[0], integers[3], MPI_CHAR, 0, world);
  all_pairs = integers[0] == 1;
  no_virial_fdotr_compute = integers[0];
  scaling = static_cast<Scaling>(integers[1]);
  cutoff = numbers[0];
  switch_width = numbers[1];
  method = static_cast<SummationMethod>(integers[2]);
  accuracy = numbers[2];
  set_up_sum();
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
  return Pair::memory_usage() + factors.capacity() * sizeof(double) +
         (sum ? sum->memory_usage() : 0.0);
}
