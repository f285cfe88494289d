// fix blast/table: a table of variables against time, one row now and then, as comma-separated
// values; a run that goes on from a restart file goes on with the table.

#ifndef BLAST_STYLES_FIX_BLAST_TABLE_H
#define BLAST_STYLES_FIX_BLAST_TABLE_H

#include "fix.h"

#include <string>
#include <vector>

namespace LAMMPS_NS {

class FixBlastTable : public Fix {
public:
  FixBlastTable(class LAMMPS *, int, char **);
  ~FixBlastTable() override;

  int setmask() override;
  void init() override;
  void setup(int) override;
  void end_of_step() override;
  void write_restart(FILE *) override;
  void restart(char *) override;

private:
  void open_file();
  void check_written();

  std::string name;
  std::vector<std::string> columns; // names of variables
  FILE *file = nullptr;             // on the first rank
  bigint last_row = -1;             // the step of it
};

} // namespace LAMMPS_NS

#endif
