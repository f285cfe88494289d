// Registers every style of this folder with the LAMMPS that loads the plugin.

#include "blast_new_run.h"
#include "blast_pulse.h"
#include "blast_read_restart.h"
#include "blast_write_restart.h"
#include "compute_blast_contact_local.h"
#include "compute_lorentz_drag_atom.h"
#include "fix_blast_bonds.h"
#include "fix_blast_losses.h"
#include "fix_blast_restart.h"
#include "fix_blast_table.h"
#include "fix_blast_watch.h"
#include "fix_lorentz_drag.h"
#include "fix_nve_implicit.h"
#include "fix_nve_sphere_lorentz.h"
#include "pair_blast_contact.h"
#include "pair_blast_near_field.h"

#include "lammps.h"
#include "library.h"

#include <cstdio>
#include <mpi.h>

using LAMMPS_NS::LAMMPS;

namespace {

// The C interface of LAMMPS plugins, as its manual states it; the header that declares it is not
// installed with LAMMPS.
extern "C" {
using LammpsFactory = void *(*)(void *);
using StyleFactory = void *(*)(void *, int, char **);

struct PluginEntry {
  const char *version, *style, *name, *info, *author;
  union {
    LammpsFactory from_lammps;
    StyleFactory from_arguments;
  } creator;
  void *handle;
};

using RegisterFunction = void (*)(PluginEntry *, void *);
}

template <class Style> void *create_from_lammps(void *lmp)
{
  return new Style(static_cast<LAMMPS *>(lmp));
}

template <class Style> void *create_style(void *lmp, int narg, char **arg)
{
  return new Style(static_cast<LAMMPS *>(lmp), narg, arg);
}

// Whether the LAMMPS that loads this plugin can use it. Nothing here looks into its classes or
// calls MPI: either may be another than the plugin was compiled for.
bool built_for(void *lmp)
{
  const int running = lammps_version(lmp);
  const bool is_of_version = running == BLAST_LAMMPS_VERSION;
  // The size of a communicator: four bytes in MPICH, eight in Open MPI. Without MPI it is 0; older
  // versions of LAMMPS say 1, whatever the MPI.
  const int size = lammps_config_has_mpi_support();
  if (is_of_version && (size == 1 || size == static_cast<int>(sizeof(MPI_Comm)))) return true;
  if (lammps_extract_setting(lmp, "world_rank") != 0) return false;
  fprintf(stderr, "lammps-blast plugin: ");
  if (is_of_version)
    fprintf(stderr, "built with another MPI");
  else
    fprintf(stderr, "built for LAMMPS version %d but loaded by version %d", BLAST_LAMMPS_VERSION,
            running);
  fprintf(stderr, ", so its styles are left out: rebuild it against this LAMMPS\n");
  return false;
}

} // namespace

extern "C" __attribute__((visibility("default"))) void lammpsplugin_init(void *lmp, void *handle,
                                                                         void *register_function)
{
  if (!built_for(lmp)) return;
  const auto register_style = reinterpret_cast<RegisterFunction>(register_function);

  PluginEntry entry{};
  entry.version = static_cast<LAMMPS *>(lmp)->version;
  entry.author = "the lammps-blast authors";
  entry.handle = handle;
  const auto add = [&](const char *style, const char *name, const char *info) {
    entry.style = style;
    entry.name = name;
    entry.info = info;
    register_style(&entry, lmp);
  };

  entry.creator.from_lammps = &create_from_lammps<LAMMPS_NS::BlastPulse>;
  add("command", "blast_pulse", "lammps-blast: radial pulse of a stated energy");

  entry.creator.from_lammps = &create_from_lammps<LAMMPS_NS::BlastNewRun>;
  add("command", "blast_new_run", "lammps-blast: a folder made ready for a run that begins anew");

  entry.creator.from_lammps = &create_from_lammps<LAMMPS_NS::BlastWriteRestart>;
  add("command", "blast_write_restart", "lammps-blast: one of two sealed restart files in turn");

  entry.creator.from_lammps = &create_from_lammps<LAMMPS_NS::BlastReadRestart>;
  add("command", "blast_read_restart", "lammps-blast: goes on from the newest whole restart file");

  entry.creator.from_lammps = &create_from_lammps<LAMMPS_NS::PairBlastContact>;
  add("pair", "blast/contact", "lammps-blast: contact, friction and bonds of spheres");

  entry.creator.from_lammps = &create_from_lammps<LAMMPS_NS::PairBlastNearField>;
  add("pair", "blast/nearfield", "lammps-blast: attraction and repulsion by powers of distance");

  entry.creator.from_arguments = &create_style<LAMMPS_NS::FixLorentzDrag>;
  add("fix", "lorentz/drag", "lammps-blast: magnetic force and drag");

  entry.creator.from_arguments = &create_style<LAMMPS_NS::FixNVESphereLorentz>;
  add("fix", "nve/sphere/lorentz", "lammps-blast: integration in a magnetic field and a medium");

  entry.creator.from_arguments = &create_style<LAMMPS_NS::FixNVEImplicit>;
  add("fix", "nve/implicit", "lammps-blast: adaptive implicit integration by the trapezoid");

  entry.creator.from_arguments = &create_style<LAMMPS_NS::ComputeLorentzDragAtom>;
  add("compute", "lorentz/drag/atom", "lammps-blast: magnetic force and drag on each sphere");

  entry.creator.from_arguments = &create_style<LAMMPS_NS::FixBlastBonds>;
  add("fix", "BLAST/BONDS", "lammps-blast: memory of pair style blast/contact");

  entry.creator.from_arguments = &create_style<LAMMPS_NS::FixBlastLosses>;
  add("fix", "blast/losses", "lammps-blast: energy lost in contacts, by channel");

  entry.creator.from_arguments = &create_style<LAMMPS_NS::FixBlastWatch>;
  add("fix", "blast/watch", "lammps-blast: stops a run that has become unstable");

  entry.creator.from_arguments = &create_style<LAMMPS_NS::FixBlastRestart>;
  add("fix", "blast/restart", "lammps-blast: ends a run when a signal asks for it");

  entry.creator.from_arguments = &create_style<LAMMPS_NS::FixBlastTable>;
  add("fix", "blast/table", "lammps-blast: variables as comma-separated values");

  entry.creator.from_arguments = &create_style<LAMMPS_NS::ComputeBlastContactLocal>;
  add("compute", "blast/contact/local", "lammps-blast: a row for each contact");
}
