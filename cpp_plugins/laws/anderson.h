// Anderson's acceleration of a fixed-point iteration: the mixture of the last iterates whose
// residual would be smallest if the iteration were linear.

#ifndef BLAST_LAWS_ANDERSON_H
#define BLAST_LAWS_ANDERSON_H

namespace blast {

constexpr int largest_anderson_depth = 5;

// The normal equations of the least-squares problem min |f - sum_j c_j d_j|, where f is the
// residual and d_j are differences of residuals of earlier iterations.
struct AndersonEquations {
  int depth = 0;
  double product[largest_anderson_depth][largest_anderson_depth] = {}; // d_i . d_j
  double with_residual[largest_anderson_depth] = {};                   // d_j . f

  // Finds the coefficients c_j. A difference that the earlier ones hold already gets none.
  void solve(double *coefficient) const
  {
    // Of a squared length; below it the rest is rounding.
    constexpr double nothing_left = 1.0e-14;
    double a[largest_anderson_depth][largest_anderson_depth + 1];
    bool dropped[largest_anderson_depth] = {};
    for (int i = 0; i < depth; i++) {
      for (int j = 0; j < depth; j++) a[i][j] = product[i][j];
      a[i][depth] = with_residual[i];
    }
    for (int k = 0; k < depth; k++) {
      dropped[k] = !(a[k][k] > nothing_left * product[k][k]);
      if (dropped[k]) continue;
      for (int i = k + 1; i < depth; i++) {
        const double ratio = a[i][k] / a[k][k];
        for (int j = k; j <= depth; j++) a[i][j] -= ratio * a[k][j];
      }
    }
    for (int k = depth - 1; k >= 0; k--) {
      coefficient[k] = 0.0;
      if (dropped[k]) continue;
      double rest = a[k][depth];
      for (int j = k + 1; j < depth; j++) rest -= a[k][j] * coefficient[j];
      coefficient[k] = rest / a[k][k];
    }
  }
};

} // namespace blast

#endif
