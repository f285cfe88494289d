// Fast summation of the near field over all pairs: a balanced tree of cells of particles. Two cells
// far apart compared with their sizes act on each other through Cartesian expansions, neighbouring
// leaves directly. The same pairs of cells meet from both sides, so that momentum is conserved to
// rounding; each target cell gathers what acts on it, so that targets can be shared out at will.

#ifndef BLAST_STYLES_NEAR_FIELD_TREE_H
#define BLAST_STYLES_NEAR_FIELD_TREE_H

#include "cartesian_expansion.h"
#include "near_field.h"
#include "near_field_sum.h"
#include "vector3.h"

#include <vector>

namespace LAMMPS_NS {

class NearFieldTree {
public:
  struct Cell {
    Range particles;
    blast::Vector3 low, high; // corners of the box about them
    blast::Vector3 centre;    // of the box
    double radius;            // about the centre, of a sphere that holds all of them
  };

  // Halves the particles of a range along the longest side of their box, and halves again, until
  // leaves hold at most `leaf_size`. Returns the particles in the order of the leaves; they must
  // be put into that order before the tree is used.
  std::vector<int> arrange(const FieldSources &, Range, int leaf_size);

  // Finds the sizes of the cells where the particles are, and their moments.
  void expand(const FieldSources &, const CartesianExpansion &, int threads);

  int leaves() const { return (static_cast<int>(cells.size()) + 1) / 2; }
  int first_leaf() const { return leaves() - 1; }
  bool is_leaf(int cell) const { return cell >= first_leaf(); }
  // Particles of leaves number begin to end - 1.
  Range particles_of_leaves(int begin, int end) const
  {
    return {cells[first_leaf() + begin].particles.begin,
            cells[first_leaf() + end - 1].particles.end};
  }
  const double *moments_of(int cell) const { return &moments[static_cast<size_t>(cell) * stride]; }
  double memory_usage() const;

  std::vector<Cell> cells; // those of a level after another; 2 c + 1 and 2 c + 2 are halves of c

private:
  std::vector<double> moments;
  int stride = 0; // coefficients of a cell
};

// What a summation did, in interactions of one particle with one other and of one cell with one
// other. Of a cell of which only some particles were wanted, that part of its interactions counts.
struct SummationWork {
  double near = 0.0, far = 0.0;
};

// One summation by tree. Two cells are far apart if the sum of their radii is less than `opening`
// times the distance of their centres.
struct TreeSummation {
  const blast::NearField &field;
  const CartesianExpansion &expansion;
  double opening;
  int threads;
  const FieldSources &particles;

  // Adds to the forces, per factor, on the targets of a range of whole leaves, and unless
  // `potential` is nullptr to their potentials, what the sources do. Returns the smallest square
  // of a distance; adds to the work done.
  double operator()(const NearFieldTree &targets, Range wanted, const NearFieldTree &sources,
                    FieldForces &forces, double *potential, SummationWork &work) const;
};

} // namespace LAMMPS_NS

#endif
