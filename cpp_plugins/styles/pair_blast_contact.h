// pair_style blast/contact: elastic contact, dissipation, friction and bonds between spheres.
//
// Every rank works out all contacts of its own particles, those with ghosts too, whether newton is
// on or off: a contact across a boundary is computed twice, and nothing has to travel back. Threads
// share the list of pairs: each changes its own particles only, and leaves what its pairs do to
// those of other threads until all are done.

#ifndef BLAST_STYLES_PAIR_BLAST_CONTACT_H
#define BLAST_STYLES_PAIR_BLAST_CONTACT_H

#include "bond.h"
#include "friction.h"
#include "power.h"
#include "vector3.h"

#include "pair.h"

#include <vector>

namespace LAMMPS_NS {

class FixBlastBonds;

// What two types of particles do to each other in contact.
struct ContactLaw {
  double stiffness = 0.0; // K_p, softened
  blast::Power exponent;  // p_p
  double damping = 0.0;   // c^cd
  blast::Friction friction;
  blast::Bond bond;

  bool needs_velocities() const
  {
    return damping > 0.0 || friction.acts() || bond.tangential_stiffness > 0.0;
  }
};

// One contact, worked out. Forces are magnitudes, but for `damping`, which is positive where it
// pulls i along the normal.
struct Contact {
  int i = 0, j = 0; // local indices; i is owned
  double distance = 0.0, strain = 0.0, area = 0.0;
  double arm_i = 0.0, arm_j = 0.0; // zero without rotation
  double elastic = 0.0, damping = 0.0, friction = 0.0, bond = 0.0, bond_friction = 0.0;
  bool bonded = false;
  bool has_just_bonded = false;   // with a bond that lasts
  blast::Vector3 normal, tangent; // n_ij and tau_ij

  blast::Vector3 tangential_force_on_i() const { return (friction + bond_friction) * tangent; }

  blast::Vector3 force_on_i() const
  {
    return (bond + damping - elastic) * normal + tangential_force_on_i();
  }
};

// Contacts in the order of the list of pairs, cut where threads share it.
using ContactParts = std::vector<std::vector<Contact>>;

class PairBlastContact : public Pair {
public:
  enum Extra { CONTACT_ENERGY, BOND_ENERGY, CONTACTS, BONDS, EXTRAS };

  explicit PairBlastContact(class LAMMPS *);
  ~PairBlastContact() override;

  void compute(int, int) override;
  void settings(int, char **) override;
  void coeff(int, char **) override;
  void init_style() override;
  double init_one(int, int) override;
  void write_restart(FILE *) override;
  void read_restart(FILE *) override;
  void write_restart_settings(FILE *) override;
  void read_restart_settings(FILE *) override;
  double single(int, int, int, int, double, double, double, double &) override;
  double memory_usage() override;

  // From now on the contacts of every force computation stay at hand until the next.
  void keep_contacts() { keeps_contacts = true; }
  const ContactParts &kept_contacts() const { return contacts; }

  // While an integrator only tries positions, bonds act as they would there, but stay as they are.
  void set_trial(bool is_trial_) { is_trial = is_trial_; }

  // Which part of a contact is this rank's: a half where another rank owns j.
  double share(const Contact &contact) const;

  // Largest strain of the last force computation on this rank, with the ids of the two; if a sphere
  // lies inside another, those two instead.
  struct DeepestContact {
    double strain = 0.0;
    tagint first = 0, second = 0;
    bool swallowed = false;

    bool surpasses(const DeepestContact &other) const
    {
      return swallowed || (!other.swallowed && strain > other.strain);
    }
  };
  const DeepestContact &deepest_contact() const { return deepest; }

  double formation_heat = 0.0; // set free by bonds that formed, this rank's share, J

private:
  // What a contact does to the particle j of another thread.
  struct Reaction {
    int j;
    blast::Vector3 force, torque;
  };
  struct BondChange {
    int j;
    tagint partner;
    bool forms; // else it parts
  };

  // What one thread finds among its pairs.
  struct ThreadShare {
    int first = 0, end = 0; // local indices of its own particles
    DeepestContact deepest;
    double formation_heat = 0.0;
    int coincident_i = -1, coincident_j = -1;
    std::vector<Reaction> reactions;
    std::vector<BondChange> bond_changes;

    void begin(int first_, int end_)
    {
      first = first_;
      end = end_;
      deepest = DeepestContact();
      formation_heat = 0.0;
      coincident_i = coincident_j = -1;
      reactions.clear();
      bond_changes.clear();
    }
    bool owns(int j) const { return first <= j && j < end; }
  };

  void allocate();
  ContactLaw &law(int itype, int jtype) { return laws[itype * (types + 1) + jtype]; }
  ContactLaw law_of_words(int narg, char **arg);
  ContactLaw mixed(int itype, int jtype);
  void find_contacts(int first, int end, bool keeps, ThreadShare &, std::vector<Contact> &found);
  Contact contact_between(int i, int j, const blast::Vector3 &offset, double distance,
                          const ContactLaw &, ThreadShare &);
  void decide_bond(Contact &, const ContactLaw &, ThreadShare &);
  void separate(int i, int j, ThreadShare &);
  void add_forces(const Contact &, ThreadShare &);
  void push(int particle, const blast::Vector3 &force, const blast::Vector3 &torque);
  void note_depth(const Contact &, DeepestContact &) const;
  void settle(const ThreadShare &);
  void tally(const Contact &, const ContactLaw &);
  double contact_energy(const Contact &, const ContactLaw &) const;
  double bond_energy(const Contact &, const ContactLaw &) const;
  void stop_at_coincidence(int i, int j);

  bool rotation = false;
  bool keeps_contacts = false;
  bool is_trial = false;
  int types = 0;
  std::vector<ContactLaw> laws;
  std::vector<double> largest_radius; // by type
  ContactParts contacts;
  std::vector<ThreadShare> shares;
  DeepestContact deepest;
  FixBlastBonds *bonds = nullptr;
};

} // namespace LAMMPS_NS

#endif
