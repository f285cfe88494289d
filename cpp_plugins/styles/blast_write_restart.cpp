#include "blast_write_restart.h"

#include "restart_box.h"
#include "restart_seal.h"
#include "style_arguments.h"

#include "comm.h"
#include "domain.h"
#include "error.h"
#include "input.h"
#include "lammps.h"
#include "modify.h"
#include "neighbor.h"
#include "output.h"
#include "update.h"
#include "utils.h"
#include "variable.h"

#include <cstdio>
#include <filesystem>
#include <map>
#include <stdexcept>
#include <utility>

using namespace LAMMPS_NS;

static constexpr char STYLE[] = "Blast_write_restart";

void BlastWriteRestart::command(int narg, char **arg)
{
  if (!domain->box_exist) error->all(FLERR, "{} command before simulation box is defined", STYLE);
  read_arguments(narg, arg);
  const RestartNotes notes_of_now = notes();

  draw_box_in(lmp);
  renew_lists();
  // Under another name, as long as it is not whole: what the file held until then is lost last.
  const std::string unfinished = files[0] + ".unfinished";
  input->one(fmt::format("write_restart \"{}\" noinit", unfinished));
  if (comm->me != 0) return;
  const std::string file = older_file();
  try {
    for (const auto &output : outputs) see_to_disk(output);
    seal_restart_file(unfinished, notes_of_now);
    std::filesystem::rename(unfinished, file);
    const auto folder = std::filesystem::path(file).parent_path();
    see_to_disk(folder.empty() ? "." : folder.string());
  } catch (const std::exception &failure) {
    error->one(FLERR, "{}: restart file {} at step {}: {}", STYLE, file, update->ntimestep,
               failure.what());
  }
  utils::logmesg(lmp, "Restart file {} written at step {}\n", file, update->ntimestep);
}

// Each rank writes the atoms, in the order, that it has in the next part of the run. LAMMPS's own
// exchange before it writes leaves the lists of neighbours as they are, in which fixes look up the
// histories of contacts.
void BlastWriteRestart::renew_lists()
{
  lmp->init();
  domain->pbc();
  domain->reset_box();
  comm->setup();
  if (neighbor->style) neighbor->setup_bins();
  comm->exchange();
  comm->borders();
  // Modify calls fixes only for those who run.
  const int caller = std::exchange(update->whichflag, 1);
  modify->setup_pre_neighbor();
  neighbor->build(1);
  modify->setup_post_neighbor();
  update->whichflag = caller;
}

void BlastWriteRestart::read_arguments(int narg, char **arg)
{
  if (narg < 2) utils::missing_cmd_args(FLERR, "blast_write_restart", error);
  for (int k = 0; k < 2; k++) {
    files[k] = arg[k];
    if (files[k].find_first_of("*%\"") != std::string::npos)
      error->all(FLERR, "{}: the name of a restart file has none of * % \", got {}", STYLE, arg[k]);
  }
  std::map<std::string, std::vector<std::string> *> lists = {
      {"outputs", &outputs}, {"logs", &logs}, {"values", &values}};
  std::vector<std::string> *list = nullptr;
  for (int iarg = 2; iarg < narg; iarg++) {
    const auto keyword = lists.find(arg[iarg]);
    if (keyword != lists.end()) {
      require_arguments(lmp, STYLE, iarg, 1, narg, arg);
      list = keyword->second;
    } else if (list) {
      list->emplace_back(arg[iarg]);
    } else {
      error->all(FLERR, "Unknown blast_write_restart keyword: {}", arg[iarg]);
    }
  }
}

// The file to be replaced: one that cannot be used, or is not of the past, as after a run has gone
// back to the one before; else the older one.
std::string BlastWriteRestart::older_file() const
{
  std::int64_t steps[2];
  for (int k = 0; k < 2; k++) {
    try {
      steps[k] = notes_of_restart_file(files[k]).step();
    } catch (const std::runtime_error &) {
      return files[k];
    }
    if (steps[k] >= update->ntimestep) return files[k];
  }
  return steps[0] <= steps[1] ? files[0] : files[1];
}

RestartNotes BlastWriteRestart::notes()
{
  RestartNotes notes;
  notes.add("step", std::to_string(update->ntimestep));
  notes.add("clock",
            fmt::format("{:.17g} {} {:.17g}", update->atime, update->atimestep, update->dt));
  notes.add("ranks", fmt::format("{} {} {} {}", comm->nprocs, comm->procgrid[0], comm->procgrid[1],
                                 comm->procgrid[2]));
  notes.add("least_box", fmt::format("{:.17g} {:.17g} {:.17g} {:.17g} {:.17g} {:.17g}",
                                     domain->minxlo, domain->minxhi, domain->minylo, domain->minyhi,
                                     domain->minzlo, domain->minzhi));
  notes.add("lammps", std::to_string(lmp->num_ver));
  notes.add("plugin", BLAST_VERSION);
  notes.add("layout", std::to_string(RESTART_LAYOUT));
  for (const auto &name : values) {
    const int index = input->variable->find(name.c_str());
    if (index < 0 || !input->variable->equalstyle(index))
      error->all(FLERR, "{}: there is no equal-style variable {}", STYLE, name);
    notes.add("value", fmt::format("{} {:.17g}", name, input->variable->compute_equal(index)));
  }
  if (comm->me == 0) note_outputs(notes);
  return notes;
}

void BlastWriteRestart::note_outputs(RestartNotes &notes) const
{
  fflush(nullptr); // logs, and dumps that are not flushed at each frame
  const auto note = [&](const char *keyword, const std::vector<std::string> &names) {
    for (const auto &name : names) {
      std::error_code failure;
      const auto size = std::filesystem::file_size(name, failure);
      if (failure) error->one(FLERR, "{}: output file {}: {}", STYLE, name, failure.message());
      notes.add(keyword, fmt::format("{} {}", size, name));
    }
  };
  note("output", outputs);
  note("log", logs);
}
