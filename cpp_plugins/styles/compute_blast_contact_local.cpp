#include "compute_blast_contact_local.h"

#include "pair_blast_contact.h"

#include "atom.h"
#include "error.h"
#include "force.h"
#include "memory.h"
#include "update.h"

#include <algorithm>

using namespace LAMMPS_NS;

static constexpr int COLUMNS = 8;

ComputeBlastContactLocal::ComputeBlastContactLocal(LAMMPS *lmp, int narg, char **arg)
    : Compute(lmp, narg, arg)
{
  if (narg != 3) error->all(FLERR, "Compute blast/contact/local takes no arguments");
  local_flag = 1;
  size_local_cols = COLUMNS;
}

ComputeBlastContactLocal::~ComputeBlastContactLocal()
{
  memory->destroy(array_local);
}

void ComputeBlastContactLocal::init()
{
  pair = static_cast<PairBlastContact *>(force->pair_match("blast/contact", 1));
  if (!pair) error->all(FLERR, "Compute blast/contact/local requires pair style blast/contact");
  pair->keep_contacts();
}

void ComputeBlastContactLocal::compute_local()
{
  invoked_local = update->ntimestep;
  const ContactParts &contacts = pair->kept_contacts();
  const tagint *tag = atom->tag;
  const int *mask = atom->mask;
  // A contact across a boundary is known to both ranks: the one with the lower id reports it.
  const auto is_reported = [&](const Contact &contact) {
    return (mask[contact.i] & groupbit) && (mask[contact.j] & groupbit) &&
           (contact.j < atom->nlocal || tag[contact.i] < tag[contact.j]);
  };

  int count = 0;
  for (const auto &part : contacts)
    count += static_cast<int>(std::count_if(part.begin(), part.end(), is_reported));
  if (count > rows) {
    rows = count;
    memory->destroy(array_local);
    memory->create(array_local, rows, COLUMNS, "blast/contact/local:array");
  }
  size_local_rows = 0;
  const auto report = [&](const Contact &contact) {
    const double row[COLUMNS] = {static_cast<double>(tag[contact.i]),
                                 static_cast<double>(tag[contact.j]),
                                 contact.strain,
                                 contact.elastic,
                                 -contact.damping,
                                 contact.friction,
                                 contact.bond,
                                 contact.bond_friction};
    std::copy(row, row + COLUMNS, array_local[size_local_rows++]);
  };
  for (const auto &part : contacts)
    for (const Contact &contact : part)
      if (is_reported(contact)) report(contact);
}

double ComputeBlastContactLocal::memory_usage()
{
  return static_cast<double>(rows) * COLUMNS * sizeof(double);
}
