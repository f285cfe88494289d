// Expansions of the near field between two cells of particles far apart, in powers of the Cartesian
// offsets from their centres, up to a total order p. Between a target at a + s and a source at b +
// t the potential is
//
//   sum over n, m with |n| + |m| <= p of  s^n / n!  D_(n+m)(a - b)  (-t)^m / m!
//
// with multi-indices n and m and the derivatives D of the potential, which is radial. What a cell
// sends out are its moments, the sums of factor (-t)^m / m!; what it receives are its local
// coefficients, those of s^n / n!. Both are cut off at the same total order, so that two cells act
// on each other with opposite forces.

#ifndef BLAST_STYLES_CARTESIAN_EXPANSION_H
#define BLAST_STYLES_CARTESIAN_EXPANSION_H

#include "near_field.h"
#include "near_field_sum.h"
#include "vector3.h"

#include <cstdint>
#include <vector>

namespace LAMMPS_NS {

// One coefficient of several cells, or monomial of several particles, that vector loops take at
// once.
struct alignas(64) Lanes {
  static constexpr int COUNT = 8;
  double at[COUNT];
};

class CartesianExpansion {
public:
  static constexpr int HIGHEST_ORDER = 14;

  explicit CartesianExpansion(int order);

  // Multi-indices of a total order up to `order` come first, sorted by it.
  static int count_up_to(int order) { return (order + 1) * (order + 2) * (order + 3) / 6; }

  // How a monomial or a derivative follows from lower ones: along `axis`, where its index is
  // `power`; `lowest` is itself less two along the axis, where that exists, else 0.
  struct Step {
    int lower, lowest, axis;
    double power;
  };

  int order, count;
  std::vector<Step> steps;                     // the first, of index 0, means nothing
  std::vector<std::vector<std::uint16_t>> sum; // sum[n][m] is the place of n + m, |n| + |m| <= p
};

// Cells whose fields a cell receives together, each in a lane.
struct FarCells {
  explicit FarCells(const CartesianExpansion &);

  // Adds a cell with its moments, `offset` from it to the target.
  void add(const blast::Vector3 &offset, const double *moments_of_cell);
  bool is_full() const { return size == Lanes::COUNT; }

  int size = 0;
  Lanes offset[3];                                 // along x, y, z
  std::vector<Lanes> moments, derivatives, locals; // by coefficient
};

// Moments of the particles of a range about a centre; overwrites.
void find_moments(const CartesianExpansion &, const FieldSources &, Range,
                  const blast::Vector3 &centre, double *moments);

// Adds moments about a centre to those about another, `offset` from the other to the one.
void shift_moments(const CartesianExpansion &, const double *from, const blast::Vector3 &offset,
                   double *to);

// Adds what the cells send to the lanes of local coefficients, and forgets the cells. The
// coefficient of order zero, the potential itself, counts only where energies are wanted.
void receive(const CartesianExpansion &, const blast::NearField &, bool energies, FarCells &);

// Adds the lanes of local coefficients up, and clears them.
void collect_locals(FarCells &, double *locals);

// Local coefficients about a centre from those about another, `offset` from the other to the one.
void shift_locals(const CartesianExpansion &, const double *from, const blast::Vector3 &offset,
                  double *to);

// Adds forces per factor and, unless it is nullptr, the potential, by index of the particle.
void evaluate_locals(const CartesianExpansion &, const double *locals, const blast::Vector3 &centre,
                     const FieldSources &, Range, FieldForces &, double *potential);

} // namespace LAMMPS_NS

#endif
