#include "fix_blast_watch.h"

#include "fix_nve_implicit.h"
#include "pair_blast_contact.h"
#include "simulated_time.h"
#include "style_arguments.h"
#include "threads.h"

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "force.h"
#include "input.h"
#include "modify.h"
#include "utils.h"
#include "variable.h"

#include <algorithm>
#include <cmath>
#include <cstring>

using namespace LAMMPS_NS;
using namespace FixConst;
using blast::Vector3;

static constexpr char STYLE[] = "Fix blast/watch";

FixBlastWatch::FixBlastWatch(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg)
{
  if (narg < 4) utils::missing_cmd_args(FLERR, STYLE, error);
  nevery = utils::inumeric(FLERR, arg[3], false, lmp);
  if (nevery <= 0) error->all(FLERR, "{} interval must be above zero: {}", STYLE, arg[3]);
  int iarg = 4;
  while (iarg < narg) {
    if (strcmp(arg[iarg], "energy") == 0) {
      require_arguments(lmp, STYLE, iarg, 2, narg, arg);
      energy_variable = arg[iarg + 1];
      if (!utils::strmatch(energy_variable, "^v_."))
        error->all(FLERR, "{} energy must name a variable v_NAME: {}", STYLE, energy_variable);
      energy_variable.erase(0, 2);
      energy_limit = positive_argument(lmp, STYLE, "energy limit", arg[iarg + 2]);
      iarg += 3;
    } else if (strcmp(arg[iarg], "strain") == 0) {
      require_arguments(lmp, STYLE, iarg, 1, narg, arg);
      strain_limit = positive_argument(lmp, STYLE, "strain limit", arg[iarg + 1]);
      iarg += 2;
    } else if (strcmp(arg[iarg], "advice") == 0) {
      require_arguments(lmp, STYLE, iarg, 1, narg, arg);
      advised_step = positive_argument(lmp, STYLE, "advised step", arg[iarg + 1]);
      iarg += 2;
    } else {
      error->all(FLERR, "Unknown {} keyword: {}", STYLE, arg[iarg]);
    }
  }
  if (!atom->radius_flag || !atom->rmass_flag)
    error->all(FLERR, "{} requires atom attributes radius and rmass", STYLE);
  if (strcmp(arg[1], "all") != 0) error->all(FLERR, "{} requires group all", STYLE);
  restart_global = 1;
  vector_flag = 1;
  size_vector = 2;
  global_freq = nevery;
  extvector = 0;
}

int FixBlastWatch::setmask()
{
  return POST_INTEGRATE | END_OF_STEP;
}

void FixBlastWatch::init()
{
  pair = static_cast<PairBlastContact *>(force->pair_match("blast/contact", 1));
  const auto adapting = modify->get_fix_by_style("^nve/implicit$");
  integrator = adapting.empty() ? nullptr : dynamic_cast<FixNVEImplicit *>(adapting.front());
  particles_touch = pair || force->pair_match("gran", 0);
  if (energy_limit == 0.0) return;
  const int variable = input->variable->find(energy_variable.c_str());
  if (variable < 0 || !input->variable->equalstyle(variable))
    error->all(FLERR, "{}: there is no equal-style variable {}", STYLE, energy_variable);
}

void FixBlastWatch::setup(int /*vflag*/)
{
  count_at_start = atom->natoms;
  tagint largest_here = 0;
  for (int i = 0; i < atom->nlocal; i++) largest_here = std::max(largest_here, atom->tag[i]);
  MPI_Allreduce(&largest_here, &largest_id_at_start, 1, MPI_LMP_TAGINT, MPI_MAX, world);
  swallowed_at_start = swallowed_pair();
  largest_kinetic = std::max(largest_kinetic, kinetic_energy());
  measure_drift();
  if (energy_limit > 0.0)
    modify->addstep_compute_all((update->ntimestep / nevery) * nevery + nevery);
}

// Tells whether a particle moves beyond its radius in a step: contacts that begin meanwhile are
// missed, or begin too deep.
static inline int is_beyond(double radius, double step, const double *velocity,
                            const Vector3 &drift)
{
  const Vector3 moved = step * (Vector3(velocity) - drift);
  return dot(moved, moved) > radius * radius ? 1 : 0;
}

// Every step, and before LAMMPS sorts particles into bins, which would stop it with less to say.
void FixBlastWatch::post_integrate()
{
  if (all_move_well()) return;
  for (int i = 0; i < atom->nlocal; i++) {
    if (!std::isfinite(norm(Vector3(atom->x[i])) + norm(Vector3(atom->v[i])))) stop_at_no_number(i);
    if (particles_touch && is_beyond(atom->radius[i], update->dt, atom->v[i], drift))
      stop_at_motion(i);
  }
}

bool FixBlastWatch::all_move_well() const
{
  std::vector<char> well(comm->nthreads);
  in_threads(comm->nthreads, atom->nlocal, [this, &well](int thread, int first, int end) {
    well[thread] = move_well(first, end) ? 1 : 0;
  });
  return std::all_of(well.begin(), well.end(), [](char is_well) { return is_well; });
}

bool FixBlastWatch::move_well(int first, int end) const
{
  if (first == end) return true;
  const double *x = atom->x[0], *v = atom->v[0], *radius = atom->radius;
  // What is no number makes this sum one that is none.
  double nothing = 0.0;
#pragma omp simd reduction(+ : nothing)
  for (int k = 3 * first; k < 3 * end; k++) nothing += 0.0 * (x[k] + v[k]);
  if (nothing != 0.0) return false;
  if (!particles_touch) return true;

  const double step = update->dt;
  const Vector3 all = drift;
  int far = 0;
#pragma omp simd reduction(+ : far)
  for (int i = first; i < end; i++) far += is_beyond(radius[i], step, v + 3 * i, all);
  return far == 0;
}

void FixBlastWatch::end_of_step()
{
  measure_drift();
  check_forces();
  check_overlap();
  check_count();
  if (energy_limit > 0.0) check_energy();
}

void FixBlastWatch::measure_drift()
{
  double here[4] = {0.0, 0.0, 0.0, static_cast<double>(atom->nlocal)}, sum[4];
  for (int i = 0; i < atom->nlocal; i++)
    for (int k = 0; k < 3; k++) here[k] += atom->v[i][k];
  MPI_Allreduce(here, sum, 4, MPI_DOUBLE, MPI_SUM, world);
  drift = sum[3] > 0.0 ? (1.0 / sum[3]) * Vector3(sum) : Vector3();
}

void FixBlastWatch::stop_at_motion(int i) const
{
  const double distance = update->dt * norm(Vector3(atom->v[i]) - drift);
  error->one(FLERR, "{}: atom {} moves by {:.3g} of its radius in a step at time {:.10g}{}", STYLE,
             atom->tag[i], distance / atom->radius[i], simulated_time(*update), advice());
}

void FixBlastWatch::stop_at_no_number(int i) const
{
  error->one(FLERR, "{}: position, velocity or force of atom {} is no number at time {:.10g}{}",
             STYLE, atom->tag[i], simulated_time(*update), advice());
}

void FixBlastWatch::check_forces() const
{
  for (int i = 0; i < atom->nlocal; i++)
    if (!std::isfinite(norm(Vector3(atom->f[i])))) stop_at_no_number(i);
}

void FixBlastWatch::check_overlap()
{
  if (!pair) return;
  const auto &contact = pair->deepest_contact();
  deepest = contact.strain;
  if (contact.swallowed && swallowed_pair() == swallowed_at_start)
    error->one(FLERR,
               "{}: of atoms {} and {} one lies inside the other at time {:.10g}, as at the start: "
               "no contact law is meant for that; let them begin farther apart",
               STYLE, contact.first, contact.second, simulated_time(*update));
  if (contact.swallowed)
    error->one(
        FLERR,
        "{}: of atoms {} and {} one lies inside the other at time {:.10g}: forces are beyond "
        "what the contact law resists{}, or a stiffer contact",
        STYLE, contact.first, contact.second, simulated_time(*update), advice());
  if (contact.strain > strain_limit)
    error->one(FLERR,
               "{}: atoms {} and {} overlap by {:.3g} of their radii at time {:.10g}: forces are "
               "beyond what the contact law resists{}, or a stiffer contact",
               STYLE, contact.first, contact.second, contact.strain, simulated_time(*update),
               advice());
}

// The ids of two spheres of which one lies inside the other; zeros if there are none.
std::pair<tagint, tagint> FixBlastWatch::swallowed_pair() const
{
  if (!pair || !pair->deepest_contact().swallowed) return {0, 0};
  return std::minmax({pair->deepest_contact().first, pair->deepest_contact().second});
}

void FixBlastWatch::check_count() const
{
  const bigint here = atom->nlocal;
  bigint count = 0;
  MPI_Allreduce(&here, &count, 1, MPI_LMP_BIGINT, MPI_SUM, world);
  if (count != count_at_start)
    error->all(FLERR, "{}: {} of {} atoms were lost by time {:.10g}{}{}", STYLE,
               count_at_start - count, count_at_start, simulated_time(*update), lost_atoms(),
               advice());
}

// The first few of the ids that are there no more, where ids began without gaps.
std::string FixBlastWatch::lost_atoms() const
{
  if (largest_id_at_start != count_at_start) return "";
  std::vector<signed char> here(largest_id_at_start + 1, 0), anywhere(here.size(), 0);
  for (int i = 0; i < atom->nlocal; i++)
    if (atom->tag[i] <= largest_id_at_start) here[atom->tag[i]] = 1;
  MPI_Allreduce(here.data(), anywhere.data(), static_cast<int>(here.size()), MPI_SIGNED_CHAR,
                MPI_MAX, world);
  constexpr int most = 5;
  std::string ids;
  int found = 0;
  for (tagint id = 1; id <= largest_id_at_start && found <= most; id++) {
    if (anywhere[id]) continue;
    ids += ++found <= most ? fmt::format(" {}", id) : " ...";
  }
  return " (IDs" + ids + ")";
}

double FixBlastWatch::kinetic_energy() const
{
  double here = 0.0, everywhere = 0.0;
  for (int i = 0; i < atom->nlocal; i++) {
    const Vector3 velocity(atom->v[i]);
    here += 0.5 * atom->rmass[i] * dot(velocity, velocity);
  }
  MPI_Allreduce(&here, &everywhere, 1, MPI_DOUBLE, MPI_SUM, world);
  return everywhere;
}

void FixBlastWatch::check_energy()
{
  largest_kinetic = std::max(largest_kinetic, kinetic_energy());
  modify->clearstep_compute();
  created = input->variable->compute_equal(input->variable->find(energy_variable.c_str()));
  modify->addstep_compute(update->ntimestep + nevery);
  if (created <= energy_limit * largest_kinetic) return;
  const tagint fastest = fastest_particle();
  error->all(FLERR,
             "{}: {:.4g} J came from nothing by time {:.10g}, with at most {:.4g} J in motion; the "
             "fastest particle is atom {}{}",
             STYLE, created, simulated_time(*update), largest_kinetic, fastest, advice());
}

tagint FixBlastWatch::fastest_particle() const
{
  struct {
    double speed;
    int rank;
  } here{-1.0, 0}, everywhere{};
  tagint fastest = 0;
  for (int i = 0; i < atom->nlocal; i++) {
    const double speed = norm(Vector3(atom->v[i]));
    if (speed > here.speed) {
      here.speed = speed;
      fastest = atom->tag[i];
    }
  }
  MPI_Comm_rank(world, &here.rank);
  MPI_Allreduce(&here, &everywhere, 1, MPI_DOUBLE_INT, MPI_MAXLOC, world);
  MPI_Bcast(&fastest, 1, MPI_LMP_TAGINT, everywhere.rank, world);
  return fastest;
}

std::string FixBlastWatch::advice() const
{
  const char *step = integrator ? "max_step" : "time step";
  if (advised_step == 0.0) return fmt::format(": try a smaller {}", step);
  const double present = integrator ? integrator->longest_step() : update->dt;
  return fmt::format(": try a {} of {:.3g} s or less", step, std::min(advised_step, 0.5 * present));
}

double FixBlastWatch::compute_vector(int n)
{
  if (n == 1) return largest_kinetic > 0.0 ? created / largest_kinetic : 0.0;
  double everywhere = 0.0;
  MPI_Allreduce(&deepest, &everywhere, 1, MPI_DOUBLE, MPI_MAX, world);
  return everywhere;
}

void FixBlastWatch::write_restart(FILE *fp)
{
  if (comm->me != 0) return;
  const int size = sizeof(largest_kinetic);
  fwrite(&size, sizeof(int), 1, fp);
  fwrite(&largest_kinetic, sizeof(largest_kinetic), 1, fp);
}

void FixBlastWatch::restart(char *buffer)
{
  memcpy(&largest_kinetic, buffer, sizeof(largest_kinetic));
}
