#include "fix_blast_table.h"

#include "simulated_time.h"

#include "comm.h"
#include "error.h"
#include "input.h"
#include "modify.h"
#include "utils.h"
#include "variable.h"

#include <cstring>

using namespace LAMMPS_NS;
using namespace FixConst;

static constexpr char STYLE[] = "Fix blast/table";

FixBlastTable::FixBlastTable(LAMMPS *lmp, int narg, char **arg) : Fix(lmp, narg, arg)
{
  if (narg < 6) utils::missing_cmd_args(FLERR, STYLE, error);
  nevery = utils::inumeric(FLERR, arg[3], false, lmp);
  if (nevery <= 0) error->all(FLERR, "{} interval must be above zero: {}", STYLE, arg[3]);
  name = arg[4];
  for (int iarg = 5; iarg < narg; iarg++) {
    if (!utils::strmatch(arg[iarg], "^v_."))
      error->all(FLERR, "{} column must name a variable v_NAME: {}", STYLE, arg[iarg]);
    columns.emplace_back(arg[iarg] + 2);
  }
  restart_global = 1;
}

FixBlastTable::~FixBlastTable()
{
  if (file) fclose(file);
}

int FixBlastTable::setmask()
{
  return END_OF_STEP;
}

void FixBlastTable::init()
{
  for (const auto &column : columns) {
    const int index = input->variable->find(column.c_str());
    if (index < 0 || !input->variable->equalstyle(index))
      error->all(FLERR, "{}: there is no equal-style variable {}", STYLE, column);
  }
  if (comm->me == 0 && !file) open_file();
  const bool is_due = update->ntimestep % nevery == 0 && update->ntimestep != last_row;
  const bigint passed = (update->ntimestep / nevery) * nevery;
  modify->addstep_compute_all(is_due ? passed : passed + nevery);
}

void FixBlastTable::open_file()
{
  const bool goes_on = last_row >= 0;
  file = fopen(name.c_str(), goes_on ? "a" : "w");
  if (!file) error->one(FLERR, "{} cannot open {}: {}", STYLE, name, utils::getsyserror());
  if (goes_on) return;
  fprintf(file, "time");
  for (const auto &column : columns) fprintf(file, ",%s", column.c_str());
  fprintf(file, "\n");
  check_written();
}

void FixBlastTable::setup(int /*vflag*/)
{
  if (update->ntimestep % nevery == 0) end_of_step();
}

void FixBlastTable::end_of_step()
{
  if (update->ntimestep == last_row) return;
  last_row = update->ntimestep;
  std::string row = fmt::format("{:.17g}", simulated_time(*update));
  modify->clearstep_compute();
  for (const auto &column : columns)
    row += fmt::format(",{:.17g}",
                       input->variable->compute_equal(input->variable->find(column.c_str())));
  modify->addstep_compute(update->ntimestep + nevery);
  if (comm->me != 0) return;
  fprintf(file, "%s\n", row.c_str());
  check_written();
}

void FixBlastTable::check_written()
{
  if (fflush(file) != 0 || ferror(file))
    error->one(FLERR, "{} cannot write {}: {}", STYLE, name, utils::getsyserror());
}

void FixBlastTable::write_restart(FILE *fp)
{
  if (comm->me != 0) return;
  const int size = sizeof(last_row);
  fwrite(&size, sizeof(int), 1, fp);
  fwrite(&last_row, sizeof(last_row), 1, fp);
}

void FixBlastTable::restart(char *buffer)
{
  memcpy(&last_row, buffer, sizeof(last_row));
}
