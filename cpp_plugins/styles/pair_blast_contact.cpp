#include "pair_blast_contact.h"

#include "contact.h"
#include "contact_energy.h"
#include "fix_blast_bonds.h"
#include "simulated_time.h"
#include "style_arguments.h"
#include "threads.h"

#include "atom.h"
#include "comm.h"
#include "domain.h"
#include "error.h"
#include "force.h"
#include "memory.h"
#include "modify.h"
#include "neigh_list.h"
#include "neighbor.h"
#include "update.h"
#include "utils.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

using namespace LAMMPS_NS;
using blast::Vector3;

static constexpr char STYLE[] = "Pair blast/contact";
static constexpr char BONDS_FIX[] = "BLAST_BONDS";

PairBlastContact::PairBlastContact(LAMMPS *lmp) : Pair(lmp)
{
  finitecutflag = 1;
  no_virial_fdotr_compute = 1;
  restartinfo = 1;
  single_enable = 1;
  nextra = EXTRAS;
  pvector = new double[EXTRAS]();
}

PairBlastContact::~PairBlastContact()
{
  delete[] pvector;
  if (copymode) return;
  if (bonds && modify->get_fix_by_id(BONDS_FIX) == bonds) modify->delete_fix(BONDS_FIX);
  if (allocated) {
    memory->destroy(setflag);
    memory->destroy(cutsq);
  }
}

void PairBlastContact::allocate()
{
  allocated = 1;
  types = atom->ntypes;
  memory->create(setflag, types + 1, types + 1, "pair:setflag");
  memory->create(cutsq, types + 1, types + 1, "pair:cutsq");
  for (int i = 0; i <= types; i++)
    for (int j = 0; j <= types; j++) setflag[i][j] = 0;
  laws.assign((types + 1) * (types + 1), ContactLaw());
}

void PairBlastContact::settings(int narg, char **arg)
{
  rotation = false;
  if (narg == 0) return;
  if (narg != 2 || strcmp(arg[0], "rotation") != 0)
    error->all(FLERR, "{} takes no settings but: rotation yes or no", STYLE);
  rotation = utils::logical(FLERR, arg[1], false, lmp) == 1;
}

void PairBlastContact::coeff(int narg, char **arg)
{
  if (narg < 2) utils::missing_cmd_args(FLERR, "pair_coeff", error);
  if (!allocated) allocate();
  int ilo, ihi, jlo, jhi;
  type_range(lmp, STYLE, arg[0], types, ilo, ihi);
  type_range(lmp, STYLE, arg[1], types, jlo, jhi);
  const ContactLaw given = law_of_words(narg, arg);

  int count = 0;
  for (int i = ilo; i <= ihi; i++)
    for (int j = std::max(jlo, i); j <= jhi; j++) {
      law(i, j) = law(j, i) = given;
      setflag[i][j] = 1;
      count++;
    }
  if (count == 0) error->all(FLERR, "Incorrect args for pair coefficients");
}

ContactLaw PairBlastContact::law_of_words(int narg, char **arg)
{
  ContactLaw law;
  double softening[4];
  bool softens = false, exponent_given = false;
  const auto require = [&](int iarg, int values) {
    require_arguments(lmp, STYLE, iarg, values, narg, arg);
  };
  const auto not_negative = [&](int iarg, const char *what) {
    return non_negative_argument(lmp, STYLE, what, arg[iarg]);
  };
  const auto positive = [&](int iarg, const char *what) {
    return positive_argument(lmp, STYLE, what, arg[iarg]);
  };

  int iarg = 2;
  while (iarg < narg) {
    if (strcmp(arg[iarg], "stiffness") == 0) {
      require(iarg, 1);
      law.stiffness = positive(iarg + 1, "stiffness");
      iarg += 2;
    } else if (strcmp(arg[iarg], "exponent") == 0) {
      require(iarg, 1);
      law.exponent = blast::Power(not_negative(iarg + 1, "exponent"));
      exponent_given = true;
      iarg += 2;
    } else if (strcmp(arg[iarg], "damping") == 0) {
      require(iarg, 1);
      law.damping = not_negative(iarg + 1, "damping");
      iarg += 2;
    } else if (strcmp(arg[iarg], "friction") == 0) {
      require(iarg, 3);
      law.friction.stiffness = positive(iarg + 1, "friction stiffness");
      law.friction.static_coefficient = not_negative(iarg + 2, "static friction");
      law.friction.dynamic_coefficient = not_negative(iarg + 3, "dynamic friction");
      iarg += 4;
    } else if (strcmp(arg[iarg], "bond") == 0) {
      require(iarg, 5);
      law.bond.stiffness = not_negative(iarg + 1, "bond stiffness");
      law.bond.exponent = blast::Power(not_negative(iarg + 2, "bond exponent"));
      law.bond.activation_strain = positive(iarg + 3, "bond activation strain");
      law.bond.tangential_stiffness = not_negative(iarg + 4, "bond tangential stiffness");
      if (strcmp(arg[iarg + 5], "contact") != 0 && strcmp(arg[iarg + 5], "none") != 0)
        error->all(FLERR, "{} bond memory must be contact or none: {}", STYLE, arg[iarg + 5]);
      law.bond.lasts = strcmp(arg[iarg + 5], "contact") == 0;
      iarg += 6;
    } else if (strcmp(arg[iarg], "thermal") == 0) {
      require(iarg, 4);
      softening[0] = not_negative(iarg + 1, "temperature");
      softening[1] = positive(iarg + 2, "reference temperature");
      softening[2] = finite_argument(lmp, STYLE, arg[iarg + 3]);
      softening[3] = positive(iarg + 4, "stiffness floor");
      softens = true;
      iarg += 5;
    } else {
      error->all(FLERR, "Unknown {} keyword: {}", STYLE, arg[iarg]);
    }
  }

  if (law.stiffness == 0.0 || !exponent_given)
    error->all(FLERR, "{} needs the keywords stiffness and exponent", STYLE);
  if (softens)
    law.stiffness = blast::softened_stiffness(law.stiffness, softening[0], softening[1],
                                              softening[2], softening[3]);
  if (!std::isfinite(law.stiffness))
    error->all(FLERR, "{} thermal makes a stiffness that is not a finite number", STYLE);
  return law;
}

void PairBlastContact::init_style()
{
  is_trial = false;
  if (strcmp(update->unit_style, "si") != 0) error->all(FLERR, "{} requires units si", STYLE);
  if (!atom->radius_flag) error->all(FLERR, "{} requires atom attribute radius", STYLE);
  if (rotation && (!atom->omega_flag || !atom->torque_flag))
    error->all(FLERR, "{} with rotation requires atom attributes omega and torque", STYLE);
  // Without ghosts the list holds the same pairs either way, and is built faster with newton on.
  const bool has_ghosts =
      comm->nprocs > 1 || domain->xperiodic || domain->yperiodic || domain->zperiodic;
  neighbor->add_request(this, NeighConst::REQ_SIZE | (has_ghosts ? NeighConst::REQ_NEWTON_OFF : 0));

  if (bonds && modify->get_fix_by_id(BONDS_FIX) != bonds)
    error->all(FLERR, "{}: fix {} was deleted: give the pair_style command again", STYLE,
               BONDS_FIX);

  std::vector<double> here(types + 1, 0.0);
  for (int i = 0; i < atom->nlocal; i++)
    here[atom->type[i]] = std::max(here[atom->type[i]], atom->radius[i]);
  largest_radius.resize(types + 1);
  MPI_Allreduce(here.data(), largest_radius.data(), types + 1, MPI_DOUBLE, MPI_MAX, world);
}

double PairBlastContact::init_one(int i, int j)
{
  if (!setflag[i][j]) law(i, j) = law(j, i) = mixed(i, j);
  const ContactLaw &between = law(i, j);
  if (between.needs_velocities() && !comm->ghost_velocity)
    error->all(FLERR, "{} with damping, friction or bonds requires: comm_modify vel yes", STYLE);
  if (between.bond.acts() && between.bond.lasts && !bonds) {
    if (!atom->tag_enable) error->all(FLERR, "{} with bonds requires atom IDs", STYLE);
    const double shortest = 2.0 * (largest_radius[i] + largest_radius[j] + neighbor->skin);
    const int *periodic = domain->periodicity;
    for (int k = 0; k < 3; k++)
      if (periodic[k] && domain->prd[k] < shortest)
        error->all(FLERR, "{} with bonds needs a periodic box longer than {:.6g} m", STYLE,
                   shortest);
    if (modify->get_fix_by_id(BONDS_FIX))
      error->all(FLERR, "{} with bonds may be used only once", STYLE);
    bonds =
        static_cast<FixBlastBonds *>(modify->add_fix(std::string(BONDS_FIX) + " all BLAST/BONDS"));
  }
  return largest_radius[i] + largest_radius[j];
}

// Between two types without a law of their own, stiffness is the mean (eq. 7.20); the paper gives
// no rule for the rest, which must agree.
ContactLaw PairBlastContact::mixed(int itype, int jtype)
{
  if (!setflag[itype][itype] || !setflag[jtype][jtype])
    error->all(FLERR, "All pair coeffs are not set");
  const ContactLaw &a = law(itype, itype), &b = law(jtype, jtype);
  const bool agree = a.exponent.exponent == b.exponent.exponent && a.damping == b.damping &&
                     a.friction.stiffness == b.friction.stiffness &&
                     a.friction.static_coefficient == b.friction.static_coefficient &&
                     a.friction.dynamic_coefficient == b.friction.dynamic_coefficient &&
                     a.bond.stiffness == b.bond.stiffness &&
                     a.bond.exponent.exponent == b.bond.exponent.exponent &&
                     a.bond.activation_strain == b.bond.activation_strain &&
                     a.bond.tangential_stiffness == b.bond.tangential_stiffness &&
                     a.bond.lasts == b.bond.lasts;
  if (!agree)
    error->all(FLERR, "{} mixes stiffness only: give a pair_coeff for types {} and {}", STYLE,
               itype, jtype);
  ContactLaw mixed = a;
  mixed.stiffness = blast::pair_stiffness(a.stiffness, b.stiffness);
  return mixed;
}

void PairBlastContact::compute(int eflag, int vflag)
{
  ev_init(eflag, vflag);
  std::fill(pvector, pvector + EXTRAS, 0.0);
  deepest = DeepestContact();

  // A pair may part unseen between two builds of the list; a new one holds all that touch.
  const bool reviews_bonds = bonds && neighbor->ago == 0 && !is_trial;
  if (reviews_bonds) bonds->begin_review();

  const int threads = comm->nthreads;
  const bool keeps = keeps_contacts || evflag;
  shares.resize(threads);
  contacts.resize(threads);
  // What a thread may change are the particles between the first and the last of its run.
  if (threads > 1 && neighbor->ago == 0 && !std::is_sorted(list->ilist, list->ilist + list->inum))
    error->one(FLERR, "{} with threads needs a neighbor list in the order of atoms", STYLE);
  in_threads(threads, list->inum, [this, keeps](int thread, int first, int end) {
    // Its own, while it is at work: threads slow each other down where their memory adjoins.
    ThreadShare share = std::move(shares[thread]);
    std::vector<Contact> found = std::move(contacts[thread]);
    find_contacts(first, end, keeps, share, found);
    shares[thread] = std::move(share);
    contacts[thread] = std::move(found);
  });
  for (const ThreadShare &share : shares) settle(share);
  if (evflag)
    for (const auto &part : contacts)
      for (const Contact &contact : part)
        tally(contact, law(atom->type[contact.i], atom->type[contact.j]));
  if (reviews_bonds) bonds->end_review();
}

// All contacts of a run of particles in the list, which LAMMPS makes in the order of their indices.
void PairBlastContact::find_contacts(int first, int end, bool keeps, ThreadShare &share,
                                     std::vector<Contact> &found)
{
  found.clear();
  share.begin(first < end ? list->ilist[first] : 0, first < end ? list->ilist[end - 1] + 1 : 0);

  double **x = atom->x;
  const double *radius = atom->radius;
  const int *type = atom->type;

  for (int ii = first; ii < end; ii++) {
    const int i = list->ilist[ii], count = list->numneigh[i];
    if (count == 0) continue;
    const Vector3 position(x[i]);
    const double radius_i = radius[i];
    const ContactLaw *laws_of_i = &law(type[i], 0);
    const bool may_part = bonds && !is_trial && bonds->has_any(i);
    const int *neighbours = list->firstneigh[i];
    for (int jj = 0; jj < count; jj++) {
      const int j = neighbours[jj] & NEIGHMASK;
      const Vector3 offset = Vector3(x[j]) - position;
      const double square = dot(offset, offset), reach = radius_i + radius[j];
      if (square > reach * reach) {
        if (may_part) separate(i, j, share);
        continue;
      }
      if (square == 0.0) {
        share.coincident_i = i;
        share.coincident_j = j;
        return;
      }
      const ContactLaw &between = laws_of_i[type[j]];
      const Contact contact = contact_between(i, j, offset, std::sqrt(square), between, share);
      add_forces(contact, share);
      if (keeps) found.push_back(contact);
      note_depth(contact, share.deepest);
    }
  }
}

// What a thread left to be done when all have looked at their pairs.
void PairBlastContact::settle(const ThreadShare &share)
{
  if (share.coincident_i >= 0) stop_at_coincidence(share.coincident_i, share.coincident_j);
  for (const Reaction &reaction : share.reactions)
    push(reaction.j, reaction.force, reaction.torque);
  for (const BondChange &change : share.bond_changes) {
    if (change.forms)
      bonds->form(change.j, change.partner);
    else
      bonds->forget(change.j, change.partner);
  }
  formation_heat += share.formation_heat;
  if (share.deepest.surpasses(deepest)) deepest = share.deepest;
}

Contact PairBlastContact::contact_between(int i, int j, const Vector3 &offset, double distance,
                                          const ContactLaw &law, ThreadShare &share)
{
  const double radius_i = atom->radius[i], radius_j = atom->radius[j];
  Contact contact;
  contact.i = i;
  contact.j = j;
  contact.distance = distance;
  contact.normal = (1.0 / distance) * offset;
  contact.strain = std::max(0.0, blast::contact_strain(distance, radius_i, radius_j));
  contact.area = std::max(0.0, blast::lens_area(distance, radius_i, radius_j));
  contact.elastic = normal_force(law.stiffness, law.exponent, contact.strain, contact.area);
  if (law.bond.acts()) decide_bond(contact, law, share);
  if (contact.bonded) contact.bond = bond_force(law.bond, contact.strain, contact.area);
  if (!law.needs_velocities()) return contact;

  Vector3 spin_i, spin_j;
  if (rotation) {
    contact.arm_i = blast::lens_arm(distance, radius_i, radius_j);
    contact.arm_j = distance - contact.arm_i;
    spin_i = Vector3(atom->omega[i]);
    spin_j = Vector3(atom->omega[j]);
  }
  const Vector3 relative = Vector3(atom->v[j]) - Vector3(atom->v[i]);
  contact.damping = blast::damping_force(law.damping, dot(relative, contact.normal), contact.area);
  const Vector3 slip =
      slip_velocity(relative, spin_i, spin_j, contact.arm_i, contact.arm_j, contact.normal);
  const double slip_speed = norm(slip);
  if (slip_speed == 0.0) return contact;
  contact.tangent = (1.0 / slip_speed) * slip;
  if (law.friction.acts())
    contact.friction =
        friction_force(law.friction, slip_speed, contact.area, update->dt, contact.elastic);
  if (contact.bonded)
    contact.bond_friction =
        blast::stick_force(law.bond.tangential_stiffness, slip_speed, contact.area, update->dt);
  return contact;
}

// Settles whether a contact is bonded, and remembers it where bonds last.
void PairBlastContact::decide_bond(Contact &contact, const ContactLaw &law, ThreadShare &own)
{
  const tagint *tag = atom->tag;
  const int i = contact.i, j = contact.j;
  const bool was_bonded = bonds && bonds->had(i, tag[j]);
  contact.bonded = is_bonded(law.bond, contact.strain, was_bonded);
  if (!contact.bonded || !law.bond.lasts) return;
  contact.has_just_bonded = !was_bonded;
  if (is_trial) return;
  bonds->form(i, tag[j]);
  if (own.owns(j))
    bonds->form(j, tag[i]);
  else if (j < atom->nlocal)
    own.bond_changes.push_back({j, tag[i], true});
  if (!was_bonded) own.formation_heat -= share(contact) * bond_energy(contact, law);
}

void PairBlastContact::separate(int i, int j, ThreadShare &own)
{
  const tagint *tag = atom->tag;
  bonds->forget(i, tag[j]);
  if (own.owns(j))
    bonds->forget(j, tag[i]);
  else if (j < atom->nlocal)
    own.bond_changes.push_back({j, tag[i], false});
}

void PairBlastContact::add_forces(const Contact &contact, ThreadShare &own)
{
  const int j = contact.j;
  const Vector3 force = contact.force_on_i();
  const Vector3 turning =
      rotation ? cross(contact.normal, contact.tangential_force_on_i()) : Vector3();
  push(contact.i, force, contact.arm_i * turning);
  if (own.owns(j))
    push(j, -1.0 * force, contact.arm_j * turning);
  else if (j < atom->nlocal)
    own.reactions.push_back({j, -1.0 * force, contact.arm_j * turning});
}

void PairBlastContact::push(int particle, const Vector3 &force, const Vector3 &torque)
{
  (Vector3(atom->f[particle]) + force).store(atom->f[particle]);
  if (rotation) (Vector3(atom->torque[particle]) + torque).store(atom->torque[particle]);
}

void PairBlastContact::note_depth(const Contact &contact, DeepestContact &deepest_yet) const
{
  DeepestContact present;
  present.strain = contact.strain;
  present.swallowed =
      blast::is_swallowed(contact.distance, atom->radius[contact.i], atom->radius[contact.j]);
  if (!present.surpasses(deepest_yet)) return;
  present.first = atom->tag[contact.i];
  present.second = atom->tag[contact.j];
  deepest_yet = present;
}

double PairBlastContact::share(const Contact &contact) const
{
  return contact.j < atom->nlocal ? 1.0 : 0.5;
}

double PairBlastContact::contact_energy(const Contact &contact, const ContactLaw &law) const
{
  return law.stiffness * blast::lens_work(law.exponent.exponent, contact.distance,
                                          atom->radius[contact.i], atom->radius[contact.j]);
}

// Zero at touch for a bond that lasts until then, else zero at the strain that activates it.
double PairBlastContact::bond_energy(const Contact &contact, const ContactLaw &law) const
{
  const double radius_i = atom->radius[contact.i], radius_j = atom->radius[contact.j];
  const double exponent = law.bond.exponent.exponent;
  double work = blast::lens_work(exponent, contact.distance, radius_i, radius_j);
  if (!law.bond.lasts) {
    const double activation = (radius_i + radius_j) * (1.0 - law.bond.activation_strain);
    work -= blast::lens_work(exponent, activation, radius_i, radius_j);
  }
  return -law.bond.stiffness * work;
}

void PairBlastContact::tally(const Contact &contact, const ContactLaw &law)
{
  double elastic = 0.0, bond = 0.0;
  if (eflag_either) {
    elastic = contact_energy(contact, law);
    if (contact.bonded) bond = bond_energy(contact, law);
    const double part = share(contact);
    pvector[CONTACT_ENERGY] += part * elastic;
    pvector[BOND_ENERGY] += part * bond;
    pvector[CONTACTS] += part;
    if (contact.bonded) pvector[BONDS] += part;
  }
  const Vector3 force = contact.force_on_i(), offset = (-contact.distance) * contact.normal;
  ev_tally_xyz(contact.i, contact.j, atom->nlocal, 0, elastic + bond, 0.0, force.x, force.y,
               force.z, offset.x, offset.y, offset.z);
}

// The forces that do not depend on velocities.
double PairBlastContact::single(int i, int j, int itype, int jtype, double square,
                                double /*factor_coul*/, double /*factor_lj*/, double &fforce)
{
  const double radius_i = atom->radius[i], radius_j = atom->radius[j];
  const double distance = std::sqrt(square);
  fforce = 0.0;
  if (distance > radius_i + radius_j || distance == 0.0) return 0.0;

  const ContactLaw &between = law(itype, jtype);
  Contact contact;
  contact.i = i;
  contact.j = j;
  contact.distance = distance;
  contact.strain = blast::contact_strain(distance, radius_i, radius_j);
  const double area = blast::lens_area(distance, radius_i, radius_j);
  double energy = contact_energy(contact, between);
  fforce = normal_force(between.stiffness, between.exponent, contact.strain, area) / distance;
  const bool was_bonded = bonds && i < atom->nlocal && bonds->has(i, atom->tag[j]);
  if (between.bond.acts() && is_bonded(between.bond, contact.strain, was_bonded)) {
    energy += bond_energy(contact, between);
    fforce -= bond_force(between.bond, contact.strain, area) / distance;
  }
  return energy;
}

void PairBlastContact::stop_at_coincidence(int i, int j)
{
  error->one(FLERR, "{}: the centres of atoms {} and {} coincide at time {:.10g}", STYLE,
             atom->tag[i], atom->tag[j], simulated_time(*update));
}

void PairBlastContact::write_restart_settings(FILE *fp)
{
  const int on = rotation ? 1 : 0;
  fwrite(&on, sizeof(int), 1, fp);
}

void PairBlastContact::read_restart_settings(FILE *fp)
{
  int on = 0;
  if (comm->me == 0) utils::sfread(FLERR, &on, sizeof(int), 1, fp, nullptr, error);
  MPI_Bcast(&on, 1, MPI_INT, 0, world);
  rotation = on == 1;
}

void PairBlastContact::write_restart(FILE *fp)
{
  write_restart_settings(fp);
  for (int i = 1; i <= types; i++)
    for (int j = i; j <= types; j++) {
      fwrite(&setflag[i][j], sizeof(int), 1, fp);
      if (!setflag[i][j]) continue;
      const ContactLaw &a = law(i, j);
      const double numbers[] = {a.stiffness,
                                a.exponent.exponent,
                                a.damping,
                                a.friction.stiffness,
                                a.friction.static_coefficient,
                                a.friction.dynamic_coefficient,
                                a.bond.stiffness,
                                a.bond.exponent.exponent,
                                a.bond.activation_strain,
                                a.bond.tangential_stiffness,
                                a.bond.lasts ? 1.0 : 0.0};
      fwrite(numbers, sizeof(numbers), 1, fp);
    }
}

void PairBlastContact::read_restart(FILE *fp)
{
  read_restart_settings(fp);
  allocate();
  for (int i = 1; i <= types; i++)
    for (int j = i; j <= types; j++) {
      double numbers[11];
      if (comm->me == 0) utils::sfread(FLERR, &setflag[i][j], sizeof(int), 1, fp, nullptr, error);
      MPI_Bcast(&setflag[i][j], 1, MPI_INT, 0, world);
      if (!setflag[i][j]) continue;
      if (comm->me == 0) utils::sfread(FLERR, numbers, sizeof(numbers), 1, fp, nullptr, error);
      MPI_Bcast(numbers, 11, MPI_DOUBLE, 0, world);
      ContactLaw a;
      a.stiffness = numbers[0];
      a.exponent = blast::Power(numbers[1]);
      a.damping = numbers[2];
      a.friction = {numbers[3], numbers[4], numbers[5]};
      a.bond = {numbers[6], blast::Power(numbers[7]), numbers[8], numbers[9], numbers[10] != 0.0};
      law(i, j) = law(j, i) = a;
    }
}

double PairBlastContact::memory_usage()
{
  double bytes = Pair::memory_usage();
  for (const auto &part : contacts) bytes += static_cast<double>(part.capacity() * sizeof(Contact));
  for (const ThreadShare &share : shares)
    bytes += static_cast<double>(share.reactions.capacity() * sizeof(Reaction) +
                                 share.bond_changes.capacity() * sizeof(BondChange));
  return bytes;
}
