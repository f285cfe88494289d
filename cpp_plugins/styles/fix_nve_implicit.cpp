#include "fix_nve_implicit.h"

#include "fix_blast_losses.h"
#include "fix_blast_watch.h"
#include "pair_blast_contact.h"
#include "simulated_time.h"
#include "style_arguments.h"

#include "atom.h"
#include "comm.h"
#include "error.h"
#include "force.h"
#include "modify.h"
#include "neighbor.h"
#include "update.h"
#include "utils.h"

#include <algorithm>
#include <cmath>
#include <cstring>

using namespace LAMMPS_NS;
using namespace FixConst;
using blast::Vector3;

static constexpr char STYLE[] = "Fix nve/implicit";

// A step that is longer or shorter than another by no more than this part is as long.
static constexpr double ROUNDING = 1.0e-9;
// Steps below this part of the run end it.
static constexpr double SMALLEST_PART = 1.0e-12;
// Of a step that moves particles farther than neighbour lists reach.
static constexpr double PART_WITHIN_REACH = 0.5;

FixNVEImplicit::FixNVEImplicit(LAMMPS *lmp, int narg, char **arg)
    : Fix(lmp, narg, arg), iteration(lmp), forces(lmp)
{
  read_arguments(narg, arg);
  fields.check(lmp, STYLE);
  if (!atom->omega_flag || !atom->torque_flag)
    error->all(FLERR, "{} requires atom attributes omega and torque", STYLE);
  iteration.groupbit = groupbit;
  adapted_step = last_step = first_step;

  time_integrate = 1;
  dynamic_group_allow = 1;
  restart_global = 1;
  force_reneighbor = 1;
  next_reneighbor = -1;
  vector_flag = 1;
  size_vector = OUTPUTS;
  global_freq = 1;
  extvector = -1;
  extlist = new int[OUTPUTS]();
  extlist[DRAG_WORK] = extlist[MAGNETIC_WORK] = 1;
}

FixNVEImplicit::~FixNVEImplicit()
{
  delete[] extlist;
  if (history) fclose(history);
}

void FixNVEImplicit::read_arguments(int narg, char **arg)
{
  for (int iarg = 3; iarg < narg;)
    if (!fields.read_keyword(lmp, STYLE, iarg, narg, arg) && !read_keyword(iarg, narg, arg))
      error->all(FLERR, "Unknown {} keyword: {}", STYLE, arg[iarg]);
  fields.complete(lmp, STYLE);
  if (control.longest_step == 0.0) error->all(FLERR, "{} needs the keyword max_step", STYLE);
  if (first_step == 0.0) first_step = control.longest_step;
  if (first_step > control.longest_step)
    error->all(FLERR, "{} first_step must not be longer than max_step", STYLE);
  // Whether it begins anew is known when the run does.
  if (history_mode && comm->me == 0) fclose(opened_history("a"));
}

bool FixNVEImplicit::read_keyword(int &iarg, int narg, char **arg)
{
  const char *keyword = arg[iarg];
  const auto is = [keyword](const char *name) { return strcmp(keyword, name) == 0; };
  const auto refuse = [&](const char *allowed) {
    error->all(FLERR, "{} {} must be {}: {}", STYLE, keyword, allowed, arg[iarg + 1]);
  };
  const char *own[] = {"phi",    "iterations", "tolerance", "first_step", "max_step",
                       "safety", "fields",     "anderson",  "file",       "append"};
  if (std::none_of(std::begin(own), std::end(own), is)) return false;
  require_arguments(lmp, STYLE, iarg, 1, narg, arg);
  const char *value = arg[iarg + 1];

  if (is("phi")) {
    iteration.trapezoid.phi = finite_argument(lmp, STYLE, value);
    if (iteration.trapezoid.phi < 0.0 || iteration.trapezoid.phi > 1.0) refuse("from 0 to 1");
  } else if (is("iterations")) {
    control.most_corrections = utils::inumeric(FLERR, value, false, lmp);
    if (control.most_corrections < 1) refuse("at least 1");
  } else if (is("tolerance")) {
    control.tolerance = positive_argument(lmp, STYLE, keyword, value);
    if (control.tolerance >= 1.0) refuse("below 1");
  } else if (is("first_step")) {
    first_step = positive_argument(lmp, STYLE, keyword, value);
  } else if (is("max_step")) {
    control.longest_step = positive_argument(lmp, STYLE, keyword, value);
  } else if (is("safety")) {
    control.safety = positive_argument(lmp, STYLE, keyword, value);
    if (control.safety > 1.0) refuse("at most 1");
  } else if (is("fields")) {
    if (strcmp(value, "iterated") != 0 && strcmp(value, "solved") != 0)
      refuse("iterated or solved");
    iteration.solves_fields = strcmp(value, "solved") == 0;
  } else if (is("anderson")) {
    iteration.anderson_depth = utils::inumeric(FLERR, value, false, lmp);
    if (iteration.anderson_depth < 0 || iteration.anderson_depth > blast::largest_anderson_depth)
      refuse("from 0 to 5");
  } else {
    history_name = value;
    history_mode = is("file") ? "w" : "a";
  }
  iarg += 2;
  return true;
}

FILE *FixNVEImplicit::opened_history(const char *mode) const
{
  FILE *file = fopen(history_name.c_str(), mode);
  if (!file) error->one(FLERR, "{} cannot open {}: {}", STYLE, history_name, utils::getsyserror());
  return file;
}

void FixNVEImplicit::open_history()
{
  history = opened_history(history_mode);
  fseek(history, 0, SEEK_END);
  if (ftell(history) == 0) fprintf(history, "time,step,corrections,error,restarts,evaluations\n");
}

int FixNVEImplicit::setmask()
{
  // Of these LAMMPS calls setup_pre_force, too: pre_force itself has nothing to do.
  return INITIAL_INTEGRATE | POST_NEIGHBOR | PRE_FORCE | POST_FORCE | FINAL_INTEGRATE;
}

void FixNVEImplicit::init()
{
  if (utils::strmatch(update->integrate_style, "^respa"))
    error->all(FLERR, "{} does not work with run_style respa", STYLE);
  // A run that an error ended inside an interval; unless the time step has been set since.
  if (clock_is_displaced && update->dt == last_step) restore_clock();
  clock_is_displaced = false;
  ExternalFields::check_sizes(lmp, STYLE, groupbit);
  if (history_mode && !history && comm->me == 0) open_history();
  forces.check(STYLE);
  refuse_companions();
  find_companions();
  has_told_of_reach = false;
  adapted_step = std::min(adapted_step, control.longest_step);
  const bigint intervals = update->laststep - update->firststep;
  smallest_step = SMALLEST_PART * update->dt * static_cast<double>(intervals);
  if (control.longest_step < smallest_step)
    error->all(FLERR, "{} max_step is below {:.3g} s, the shortest step of so long a run: {:g}",
               STYLE, smallest_step, control.longest_step);
}

void FixNVEImplicit::find_companions()
{
  contacts.clear();
  const auto add = [this](Pair *pair) {
    auto *contact = dynamic_cast<PairBlastContact *>(pair);
    if (contact) contacts.push_back(contact);
    return contact != nullptr;
  };
  // By the number among those of a hybrid style, where there is more than one.
  if (!add(force->pair_match("blast/contact", 1)))
    for (int number = 1; add(force->pair_match("blast/contact", 1, number)); number++);
  losses.clear();
  for (auto *fix : modify->get_fix_by_style("^blast/losses$"))
    losses.push_back(dynamic_cast<FixBlastLosses *>(fix));
  watches.clear();
  for (auto *fix : modify->get_fix_by_style("^blast/watch$"))
    watches.push_back(dynamic_cast<FixBlastWatch *>(fix));
}

// Fixes and pair styles that do not bear forces being evaluated several times a step, and those
// that would move the same particles.
void FixNVEImplicit::refuse_companions() const
{
  for (const auto &other : modify->get_fix_list()) {
    if (other == this) continue;
    if (other->time_integrate)
      error->all(FLERR, "{} must be the only fix that integrates: remove fix {}", STYLE, other->id);
    if (strcmp(other->style, "NEIGH_HISTORY") == 0 || utils::strmatch(other->style, "^wall/gran"))
      error->all(FLERR,
                 "{} does not work with contacts that remember how far they have slipped (fix {}): "
                 "their memory would grow with every evaluation of forces",
                 STYLE, other->id);
    if (strcmp(other->style, "lorentz/drag") == 0)
      error->all(FLERR, "{} applies magnetic field and drag itself: remove fix {}", STYLE,
                 other->id);
  }
}

// The forces at the beginning of a run are those at the end of the step that led there.
void FixNVEImplicit::setup_pre_force(int /*vflag*/)
{
  displace_clock();
  update->dt = last_step;
}

void FixNVEImplicit::setup(int /*vflag*/)
{
  iteration.add_external_forces(fields);
  // Once: a run that goes on from a restart file counts as one that was not interrupted.
  if (evaluations == 0) evaluations = 1;
  restore_clock();
}

void FixNVEImplicit::setup_post_neighbor()
{
  post_neighbor();
}

void FixNVEImplicit::post_neighbor()
{
  listed_position.clear();
  if (atom->nlocal > 0)
    listed_position.assign(atom->x[0], atom->x[0] + 3 * static_cast<size_t>(atom->nlocal));
  lists_are_fresh = true;
}

void FixNVEImplicit::post_force(int /*vflag*/)
{
  iteration.add_external_forces(fields);
  evaluations++;
}

void FixNVEImplicit::initial_integrate(int /*vflag*/)
{
  displace_clock();
  try {
    cross_interval();
  } catch (...) {
    restore_clock();
    throw;
  }
}

void FixNVEImplicit::cross_interval()
{
  const double end = simulated_time(*update);
  double left = update->dt;
  while (true) {
    time = end - left;
    begin_step();
    const double step = take_step(left);
    if (step == left) break;
    left -= step;
    settle();
  }
  // LAMMPS itself renews lists, if need be, and computes the forces.
  if (lists_need_renewal()) next_reneighbor = update->ntimestep;
  if (history && fflush(history) != 0)
    error->one(FLERR, "{} cannot write {}: {}", STYLE, history_name, utils::getsyserror());
}

void FixNVEImplicit::final_integrate()
{
  restore_clock();
}

void FixNVEImplicit::begin_step()
{
  iteration.begin();
  for (auto *fix : losses) fix->begin_step();
}

// Takes a step that is no longer than what is left of the interval, and returns its length.
double FixNVEImplicit::take_step(double left)
{
  double reach = left;
  while (true) {
    double step = std::min(adapted_step, reach);
    if (step > (1.0 - ROUNDING) * left) step = left;
    const bool is_cut = step < (1.0 - ROUNDING) * adapted_step;
    const Attempt tried = attempt(step);
    if (tried.end == Attempt::CONVERGED) {
      accept(step, tried, is_cut);
      return step;
    }
    if (tried.end == Attempt::OUT_OF_REACH && !lists_are_fresh) {
      iteration.go_back();
      renew_lists_at_beginning();
    } else if (tried.end == Attempt::OUT_OF_REACH && tried.corrections == 0) {
      tell_of_reach(step);
      reach = PART_WITHIN_REACH * step;
      if (reach < smallest_step)
        stop(step,
             fmt::format("particles move beyond half the skin of the neighbor lists, {:.3g} m",
                         neighbor->skin));
      iteration.go_back();
    } else {
      shrink(step, tried);
      iteration.go_back();
    }
  }
}

FixNVEImplicit::Attempt FixNVEImplicit::attempt(double step)
{
  Attempt tried;
  set_clock(step, time + step);
  iteration.correct(fields, step);
  if (iteration.trapezoid.phi == 0.0) {
    // An explicit step, which no correction changes.
    tried.corrections = 1;
    tried.error = iteration_error();
    if (std::isfinite(tried.error)) return {Attempt::CONVERGED, 1, 0.0};
    return tried;
  }
  while (true) {
    if (!is_within_reach()) {
      tried.end = Attempt::OUT_OF_REACH;
      return tried;
    }
    iteration.take();
    evaluate_trial();
    iteration.correct(fields, step);
    tried.corrections++;
    tried.error = iteration_error();
    if (control.accepts(tried.error)) {
      tried.end = Attempt::CONVERGED;
      return tried;
    }
    if (tried.corrections == control.most_corrections || !std::isfinite(tried.error)) return tried;
    iteration.accelerate();
  }
}

// Summed in one place, so that all ranks decide alike.
double FixNVEImplicit::iteration_error() const
{
  const double here[2] = {iteration.correction, iteration.motion};
  double everywhere[2] = {0.0, 0.0};
  MPI_Reduce(here, everywhere, 2, MPI_DOUBLE, MPI_SUM, 0, world);
  MPI_Bcast(everywhere, 2, MPI_DOUBLE, 0, world);
  return blast::iteration_error(everywhere[0], everywhere[1]);
}

void FixNVEImplicit::accept(double step, const Attempt &tried, bool is_cut)
{
  iteration.work_out_means();
  iteration.tally_work(tally);
  for (auto *fix : losses)
    fix->count_step(step, iteration.trapezoid.phi, iteration.mean_velocity(),
                    iteration.mean_spin());
  iteration.take();
  lists_are_fresh = false;
  last = tried;
  last_step = step;
  steps++;
  if (!is_cut) adapted_step = control.step_after(step, tried.error, tried.corrections);
  if (history)
    fprintf(history, "%.17g,%.17g,%d,%.6g," BIGINT_FORMAT "," BIGINT_FORMAT "\n", time + step, step,
            tried.corrections, tried.error, restarts, evaluations);
}

void FixNVEImplicit::shrink(double step, const Attempt &tried)
{
  const double factor = tried.end == Attempt::OUT_OF_REACH
                            ? PART_WITHIN_REACH
                            : control.factor(tried.error, tried.corrections);
  adapted_step = factor * step;
  restarts++;
  if (tried.end == Attempt::OUT_OF_REACH) tell_of_reach(step);
  if (adapted_step < smallest_step)
    stop(step, fmt::format("no convergence: the error is {:.3g} after {} corrections", tried.error,
                           tried.corrections));
}

// Once a run.
void FixNVEImplicit::tell_of_reach(double step)
{
  if (!has_told_of_reach && comm->me == 0)
    error->warning(FLERR,
                   "{} halves steps in which particles move beyond half the skin of the neighbor "
                   "lists, {:.3g} m, the first at time {:.10g} with {:.3g} s: a wider skin would "
                   "allow longer steps",
                   STYLE, neighbor->skin, time, step);
  has_told_of_reach = true;
}

void FixNVEImplicit::evaluate_trial()
{
  for (auto *contact : contacts) contact->set_trial(true);
  forces.evaluate();
  for (auto *contact : contacts) contact->set_trial(false);
}

// Forces at the state that a step has led to, within an interval.
void FixNVEImplicit::settle()
{
  for (auto *watch : watches) watch->post_integrate();
  if (lists_need_renewal())
    forces.renew_lists();
  else
    neighbor->ago++;
  forces.evaluate();
}

// The lists do not reach as far as the step that begins here.
void FixNVEImplicit::renew_lists_at_beginning()
{
  set_clock(last_step, time);
  forces.renew_lists();
  forces.evaluate();
  begin_step();
}

// Tells whether the lists hold all pairs that may meet at the positions of the last correction.
bool FixNVEImplicit::is_within_reach() const
{
  if (neighbor->nlist == 0) return true;
  const double move = largest_move(iteration.result_position(), 0.0);
  return !(move > 0.5 * neighbor->skin);
}

// Lists are to last for the next step; particles that have none change ranks as in other runs.
bool FixNVEImplicit::lists_need_renewal() const
{
  const double ahead = neighbor->nlist == 0 ? 0.0 : 2.0 * adapted_step;
  return largest_move(atom->nlocal > 0 ? atom->x[0] : nullptr, ahead) > 0.5 * neighbor->skin;
}

// How far any particle has moved since lists were built, and may move in a time ahead.
double FixNVEImplicit::largest_move(const double *position, double ahead) const
{
  double here = 0.0, everywhere = 0.0;
  if (atom->nlocal > 0) {
    const double *listed = listed_position.data(), *velocity = atom->v[0];
#pragma omp simd reduction(max : here)
    for (int i = 0; i < atom->nlocal; i++) {
      const Vector3 moved = Vector3(position + 3 * i) - Vector3(listed + 3 * i);
      const double reached = norm(moved) + ahead * norm(Vector3(velocity + 3 * i));
      here = reached > here ? reached : here;
    }
  }
  MPI_Allreduce(&here, &everywhere, 1, MPI_DOUBLE, MPI_MAX, world);
  return everywhere;
}

void FixNVEImplicit::displace_clock()
{
  clock_is_displaced = true;
  clock_of_intervals = {update->dt, update->atime, update->atimestep};
}

void FixNVEImplicit::restore_clock()
{
  update->dt = clock_of_intervals.step;
  update->atime = clock_of_intervals.time;
  update->atimestep = clock_of_intervals.time_step;
  clock_is_displaced = false;
}

// Laws that ask LAMMPS for the time or the time step get those of the present step.
void FixNVEImplicit::set_clock(double step, double now)
{
  update->dt = step;
  update->atime = now;
  update->atimestep = update->ntimestep;
}

void FixNVEImplicit::stop(double step, const std::string &why) const
{
  const auto here = iteration.farthest_mover();
  struct {
    double distance;
    int rank;
  } farthest{here.distance, comm->me}, overall{};
  if (here.index >= 0 && !std::isfinite(here.distance)) farthest.distance = HUGE_VAL;
  MPI_Allreduce(&farthest, &overall, 1, MPI_DOUBLE_INT, MPI_MAXLOC, world);

  std::string worst(200, ' ');
  if (comm->me == overall.rank && here.index >= 0) {
    const int i = here.index;
    const ExternalForces &external = iteration.external_forces();
    const auto shown = [](const Vector3 &force) {
      return fmt::format("({:.4g}, {:.4g}, {:.4g})", force.x, force.y, force.z);
    };
    worst = fmt::format("atom {} moves most, by {:.3g} m in the last correction, under a force of "
                        "{} N, {} N of it drag and {} N magnetic",
                        atom->tag[i], here.distance, shown(Vector3(atom->f[i])),
                        shown(external.drag[i]), shown(external.magnetic[i]));
  }
  int length = static_cast<int>(worst.size());
  MPI_Bcast(&length, 1, MPI_INT, overall.rank, world);
  worst.resize(length);
  MPI_Bcast(&worst[0], length, MPI_CHAR, overall.rank, world);
  error->all(FLERR, "{}: {} at time {:.10g} with a step of {:.3g} s; {}", STYLE, why, time, step,
             worst);
}

double FixNVEImplicit::compute_vector(int n)
{
  switch (n) {
  case STEP:
    return adapted_step;
  case CORRECTIONS:
    return last.corrections;
  case ERROR:
    return last.error;
  case STEPS:
    return static_cast<double>(steps);
  case RESTARTS:
    return static_cast<double>(restarts);
  case EVALUATIONS:
    return static_cast<double>(evaluations);
  default:
    return tally.total(n, world);
  }
}

double FixNVEImplicit::memory_usage()
{
  return iteration.memory_usage() +
         static_cast<double>(listed_position.capacity() * sizeof(double));
}

void FixNVEImplicit::write_restart(FILE *fp)
{
  tally.gather_on_first_rank(world);
  const double numbers[] = {tally.energy[DRAG_WORK],
                            tally.energy[MAGNETIC_WORK],
                            adapted_step,
                            last_step,
                            static_cast<double>(last.corrections),
                            last.error,
                            static_cast<double>(steps),
                            static_cast<double>(restarts),
                            static_cast<double>(evaluations)};
  if (comm->me != 0) return;
  const int size = sizeof(numbers);
  fwrite(&size, sizeof(int), 1, fp);
  fwrite(numbers, sizeof(numbers), 1, fp);
}

void FixNVEImplicit::restart(char *buffer)
{
  const char *numbers = buffer;
  const auto next = [&numbers] {
    double number;
    memcpy(&number, numbers, sizeof(double));
    numbers += sizeof(double);
    return number;
  };
  for (double &energy : tally.energy) {
    const double everywhere = next();
    energy = comm->me == 0 ? everywhere : 0.0;
  }
  adapted_step = next();
  last_step = next();
  last.corrections = static_cast<int>(next());
  last.error = next();
  steps = static_cast<bigint>(next());
  restarts = static_cast<bigint>(next());
  evaluations = static_cast<bigint>(next());
  if (history_mode) history_mode = "a";
}
