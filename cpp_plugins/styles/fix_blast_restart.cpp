#include "fix_blast_restart.h"

#include "kept_output.h"
#include "style_arguments.h"

#include "comm.h"
#include "error.h"
#include "output.h"
#include "platform.h"
#include "timer.h"
#include "update.h"
#include "utils.h"

#include <algorithm>
#include <atomic>
#include <csignal>
#include <cstring>
#include <ctime>
#include <stdexcept>
#include <utility>

using namespace LAMMPS_NS;
using namespace FixConst;

static constexpr char STYLE[] = "Fix blast/restart";

// What asks a program to end: a batch system or `kill`, the keyboard, a batch system ahead of time,
// a terminal that is closed.
static constexpr int SIGNALS[] = {SIGTERM, SIGINT, SIGUSR1, SIGHUP};
// Steps between two looks at whether any of several ranks was asked to stop, unless they are so
// long (s) that a look costs nothing beside one.
static constexpr int STEPS_BETWEEN_LOOKS = 10;
static constexpr double LONG_STEP = 0.01;

static constexpr std::time_t SECONDS_OF_ONE_WISH = 10;

// A signal can tell nobody else. Of the process, as signals are.
static volatile std::sig_atomic_t signal_that_asked = 0;
static volatile std::sig_atomic_t has_been_asked = 0;
static int listeners = 0;
static std::vector<std::pair<int, struct sigaction>> listened; // and what they did before

// For those who have LAMMPS in their own process.
extern "C" __attribute__((visibility("default"))) void lammps_blast_stop(int signal)
{
  FixBlastRestart::ask_to_stop(signal);
}

FixBlastRestart::FixBlastRestart(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg)
{
  for (int iarg = 3; iarg < narg; iarg += 2) {
    const bool is_lock = strcmp(arg[iarg], "lock") == 0;
    if (!is_lock && strcmp(arg[iarg], "binary") != 0)
      error->all(FLERR, "Unknown {} keyword: {}", STYLE, arg[iarg]);
    require_arguments(lmp, STYLE, iarg, 1, narg, arg);
    if (is_lock)
      take_lock(arg[iarg + 1]);
    else
      binary_dumps.emplace_back(arg[iarg + 1]);
  }
  nevery = 1;
  restart_global = 1;
  listen();
}

FixBlastRestart::~FixBlastRestart()
{
  if (--listeners > 0) return;
  signal_that_asked = 0;
  // A signal that is handed on late must not end the program that is about to end.
  if (has_been_asked) return;
  for (const auto &[signal, before] : listened) {
    struct sigaction present;
    sigaction(signal, nullptr, &present);
    if (present.sa_handler == &FixBlastRestart::ask_to_stop) sigaction(signal, &before, nullptr);
  }
  listened.clear();
}

void FixBlastRestart::take_lock(const char *name)
{
  if (comm->me != 0) return;
  try {
    lock = lock_taken_over(name);
  } catch (const std::runtime_error &failure) {
    error->one(FLERR, "{}: {}", STYLE, failure.what());
  }
}

// Where nobody else listens: a program that has LAMMPS in it may have its own way.
void FixBlastRestart::listen()
{
  if (listeners++ == 0) has_been_asked = 0;
  for (const int signal : SIGNALS) {
    struct sigaction before;
    sigaction(signal, nullptr, &before);
    if (before.sa_handler != SIG_DFL) continue;
    struct sigaction asking = {};
    asking.sa_handler = &FixBlastRestart::ask_to_stop;
    asking.sa_flags = SA_RESTART;
    sigaction(signal, &asking, nullptr);
    listened.push_back({signal, before});
  }
}

// Launchers hand signals on that the ranks have got as well: the same wish, told twice. One that
// comes later is meant to end the program at once.
void FixBlastRestart::ask_to_stop(int signal)
{
  static std::atomic<std::time_t> asked_at{0};
  struct timespec now;
  clock_gettime(CLOCK_MONOTONIC, &now);
  if (!has_been_asked) {
    asked_at = now.tv_sec;
  } else if (now.tv_sec - asked_at > SECONDS_OF_ONE_WISH) {
    std::signal(signal, SIG_DFL);
    std::raise(signal);
  }
  signal_that_asked = signal;
  has_been_asked = 1;
}

int FixBlastRestart::setmask()
{
  return END_OF_STEP;
}

// Dumps do not know that their frame of this step was written before the restart.
void FixBlastRestart::setup(int /*vflag*/)
{
  const size_t known = std::min(frames_written.size(), static_cast<size_t>(output->ndump));
  for (size_t k = 0; k < known; k++)
    if (output->last_dump[k] < 0) output->last_dump[k] = frames_written[k];
  if (comm->me != 0 || output->ndump == 0) return;
  for (const auto &name : binary_dumps) {
    try {
      if (goes_on)
        go_on_with_output(name);
      else
        forget_kept_output(name);
    } catch (const std::exception &failure) {
      error->one(FLERR, "{}: {}", STYLE, failure.what());
    }
  }
}

void FixBlastRestart::end_of_step()
{
  const int asked = comm->nprocs == 1 ? signal_that_asked : signal_of_any_rank();
  if (asked == 0) return;
  signal_that_asked = 0;
  if (comm->me == 0)
    utils::logmesg(lmp, "Signal {} ends the run at step {}\n", asked, update->ntimestep);
  timer->force_timeout();
}

// Ranks look together, so after equally many steps.
int FixBlastRestart::signal_of_any_rank()
{
  if (--steps_to_look > 0) return 0;
  const double now = platform::walltime();
  double seen[2] = {static_cast<double>(signal_that_asked), (now - last_look) / steps_of_look};
  last_look = now;
  MPI_Allreduce(MPI_IN_PLACE, seen, 2, MPI_DOUBLE, MPI_MAX, world);
  steps_of_look = steps_to_look = seen[1] < LONG_STEP ? STEPS_BETWEEN_LOOKS : 1;
  return static_cast<int>(seen[0]);
}

void FixBlastRestart::write_restart(FILE *fp)
{
  if (comm->me != 0) return;
  std::vector<bigint> numbers = {output->ndump};
  numbers.insert(numbers.end(), output->last_dump, output->last_dump + output->ndump);
  const int size = static_cast<int>(numbers.size() * sizeof(bigint));
  fwrite(&size, sizeof(int), 1, fp);
  fwrite(numbers.data(), sizeof(bigint), numbers.size(), fp);
}

void FixBlastRestart::restart(char *buffer)
{
  goes_on = true;
  bigint count;
  memcpy(&count, buffer, sizeof(bigint));
  frames_written.resize(count);
  memcpy(frames_written.data(), buffer + sizeof(bigint), count * sizeof(bigint));
}
