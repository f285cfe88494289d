#include "blast_read_restart.h"

#include "file_lock.h"
#include "kept_output.h"
#include "restart_box.h"
#include "style_arguments.h"

#include "comm.h"
#include "domain.h"
#include "error.h"
#include "input.h"
#include "lammps.h"
#include "update.h"
#include "utils.h"
#include "variable.h"

#include <cmath>
#include <cstring>
#include <filesystem>
#include <sstream>
#include <stdexcept>

using namespace LAMMPS_NS;

static constexpr char STYLE[] = "Blast_read_restart";

namespace {

// A size in bytes and the name of a file.
struct OutputNote {
  std::uintmax_t size = 0;
  std::string name;

  explicit OutputNote(const std::string &text)
  {
    std::istringstream stream(text);
    stream >> size;
    stream.get();
    std::getline(stream, name);
  }
};

// Output that was lost cannot be gone on with.
void check_outputs(const RestartNotes &notes)
{
  for (const auto &line : notes.all("output")) {
    const OutputNote output(line);
    take_output_back(output.name);
    std::error_code failure;
    const auto size = std::filesystem::file_size(output.name, failure);
    if (failure) throw std::runtime_error("goes with " + output.name + ": " + failure.message());
    if (size < output.size)
      throw std::runtime_error(fmt::format("goes with {} bytes of {}, which has only {}",
                                           output.size, output.name, size));
  }
}

} // namespace

void BlastReadRestart::command(int narg, char **arg)
{
  read_arguments(narg, arg);
  const Chosen chosen = told_to_all(newest_whole());
  check_versions(chosen);
  if (last_step && chosen.notes.step() > *last_step)
    error->all(FLERR,
               "{}: the run in {} has come to step {} already, beyond its new end at step {}",
               STYLE, chosen.file, chosen.notes.step(), *last_step);
  arrange_ranks(chosen.notes);
  input->one(fmt::format("read_restart \"{}\"", chosen.file));
  restore_box(chosen.notes);
  restore_clock(chosen.notes);
  check_step();
  restore_values(chosen.notes);
  if (comm->me != 0) return;
  try {
    cut_outputs_back(chosen.notes);
  } catch (const std::exception &failure) {
    error->one(FLERR, "{}: {}", STYLE, failure.what());
  }
}

void BlastReadRestart::read_arguments(int narg, char **arg)
{
  int iarg = 0;
  const auto is_keyword = [&](const char *word) {
    return strcmp(word, "lock") == 0 || strcmp(word, "step") == 0 || strcmp(word, "upto") == 0;
  };
  while (iarg < narg && !is_keyword(arg[iarg])) files.emplace_back(arg[iarg++]);
  if (files.empty()) utils::missing_cmd_args(FLERR, "blast_read_restart", error);
  for (; iarg < narg; iarg += 2) {
    require_arguments(lmp, STYLE, iarg, 1, narg, arg);
    const char *value = arg[iarg + 1];
    if (strcmp(arg[iarg], "lock") == 0) {
      // Output must not be cut back while another run writes it.
      take_lock_for_fix(lmp, STYLE, value);
    } else if (strcmp(arg[iarg], "step") == 0) {
      step = positive_argument(lmp, STYLE, "step", value);
    } else if (strcmp(arg[iarg], "upto") == 0) {
      last_step = utils::bnumeric(FLERR, value, false, lmp);
      if (*last_step < 0) error->all(FLERR, "{} upto must not be below zero, got {}", STYLE, value);
    } else {
      error->all(FLERR, "Unknown blast_read_restart keyword: {}", arg[iarg]);
    }
  }
}

BlastReadRestart::Chosen BlastReadRestart::newest_whole() const
{
  Chosen newest;
  if (comm->me != 0) return newest;
  std::string reasons;
  for (const auto &file : files) {
    try {
      const RestartNotes notes = notes_of_whole_restart_file(file);
      check_outputs(notes);
      if (newest.file.empty() || notes.step() > newest.notes.step()) newest = {file, notes};
    } catch (const std::runtime_error &failure) {
      reasons += fmt::format("\n  {} {}", file, failure.what());
    }
  }
  if (newest.file.empty())
    error->one(FLERR, "{}: there is no restart file to go on from:{}", STYLE, reasons);
  if (!reasons.empty())
    error->warning(FLERR, "{} goes on from {}, since{}", STYLE, newest.file, reasons);
  return newest;
}

BlastReadRestart::Chosen BlastReadRestart::told_to_all(Chosen chosen) const
{
  const auto tell = [this](std::string text) {
    int length = static_cast<int>(text.size());
    MPI_Bcast(&length, 1, MPI_INT, 0, world);
    text.resize(length);
    MPI_Bcast(&text[0], length, MPI_CHAR, 0, world);
    return text;
  };
  return {tell(chosen.file), RestartNotes::of_text(tell(chosen.notes.text()))};
}

void BlastReadRestart::check_versions(const Chosen &chosen) const
{
  if (chosen.notes.values("layout") != std::to_string(RESTART_LAYOUT))
    error->all(
        FLERR,
        "{}: restart file {} holds other numbers than this plugin, version {}, expects: go on "
        "with version {}, which wrote it",
        STYLE, chosen.file, BLAST_VERSION, chosen.notes.values("plugin"));
  if (comm->me != 0) return;
  const auto compare = [&](const char *what, const std::string &then, const std::string &now) {
    if (then != now)
      error->warning(FLERR, "Restart file {} was written by {} version {}, this is version {}",
                     chosen.file, what, then, now);
  };
  compare("LAMMPS", chosen.notes.values("lammps"), std::to_string(lmp->num_ver));
  compare("lammps-blast plugin", chosen.notes.values("plugin"), BLAST_VERSION);
}

// As many ranks share the box as they did, so that each finds its own atoms in their order.
void BlastReadRestart::arrange_ranks(const RestartNotes &notes) const
{
  int count = 0, grid[3] = {0, 0, 0};
  std::istringstream(notes.values("ranks")) >> count >> grid[0] >> grid[1] >> grid[2];
  if (count == comm->nprocs && comm->layout != Comm::LAYOUT_TILED)
    input->one(fmt::format("processors {} {} {}", grid[0], grid[1], grid[2]));
}

void BlastReadRestart::restore_box(const RestartNotes &notes) const
{
  std::istringstream(notes.values("least_box")) >> domain->minxlo >> domain->minxhi >>
      domain->minylo >> domain->minyhi >> domain->minzlo >> domain->minzhi;
  draw_box_in(lmp);
}

// LAMMPS keeps the number of the step, not the time that belongs to it.
void BlastReadRestart::restore_clock(const RestartNotes &notes) const
{
  std::istringstream(notes.values("clock")) >> update->atime >> update->atimestep >> update->dt;
}

// The numbers of steps and the intervals of output rest on it.
void BlastReadRestart::check_step() const
{
  if (step > 0.0 && std::abs(update->dt - step) > 1.0e-9 * step)
    error->all(FLERR, "{}: the run to go on with has a time step of {:g} s, not of {:g} s", STYLE,
               update->dt, step);
}

void BlastReadRestart::restore_values(const RestartNotes &notes) const
{
  for (const auto &line : notes.all("value")) {
    const auto space = line.find(' ');
    input->variable->set(line.substr(0, space) + " equal " + line.substr(space + 1));
  }
}

void BlastReadRestart::cut_outputs_back(const RestartNotes &notes) const
{
  for (const auto &line : notes.all("output")) {
    const OutputNote output(line);
    std::filesystem::resize_file(output.name, output.size);
    if (is_binary_dump(output.name)) keep_output(output.name);
  }
  // The log is a story, not data: it may have been lost.
  for (const auto &line : notes.all("log")) {
    const OutputNote log(line);
    std::error_code failure;
    if (std::filesystem::file_size(log.name, failure) > log.size && !failure)
      std::filesystem::resize_file(log.name, log.size);
  }
}
