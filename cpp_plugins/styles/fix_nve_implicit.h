// fix nve/implicit: the phi-trapezoid of section 8, solved by fixed-point iteration, in steps that
// adapt to how fast the iteration converges.
//
// A time step of LAMMPS is an interval that the fix crosses in steps of its own. In each it tries
// positions and velocities, has LAMMPS's forces evaluated there, and corrects. The forces at the
// end of the interval are those that LAMMPS computes in its own time step.

#ifndef BLAST_STYLES_FIX_NVE_IMPLICIT_H
#define BLAST_STYLES_FIX_NVE_IMPLICIT_H

#include "energy_tally.h"
#include "external_fields.h"
#include "force_evaluation.h"
#include "step_control.h"
#include "trapezoid_iteration.h"

#include "fix.h"

#include <cstdio>
#include <string>
#include <vector>

namespace LAMMPS_NS {

class FixNVEImplicit : public Fix {
public:
  FixNVEImplicit(class LAMMPS *, int, char **);
  ~FixNVEImplicit() override;

  int setmask() override;
  void init() override;
  void setup_pre_force(int) override;
  void setup(int) override;
  void initial_integrate(int) override;
  void setup_post_neighbor() override;
  void post_neighbor() override;
  void pre_force(int) override {}
  void post_force(int) override;
  void final_integrate() override;
  double compute_vector(int) override;
  double memory_usage() override;
  void write_restart(FILE *) override;
  void restart(char *) override;

  double longest_step() const { return control.longest_step; }

private:
  enum Output { STEP = FIELD_WORKS, CORRECTIONS, ERROR, STEPS, RESTARTS, EVALUATIONS, OUTPUTS };

  // How an attempt at a step ended.
  struct Attempt {
    enum End { CONVERGED, DIVERGED, OUT_OF_REACH } end = DIVERGED;
    int corrections = 0; // K
    double error = 1.0;  // of the last correction
  };

  // What LAMMPS's own clock shows, which goes by intervals.
  struct Clock {
    double step = 0.0, time = 0.0;
    bigint time_step = 0;
  };

  void read_arguments(int narg, char **arg);
  bool read_keyword(int &iarg, int narg, char **arg);
  FILE *opened_history(const char *mode) const;
  void open_history();
  void refuse_companions() const;
  void find_companions();

  void cross_interval();
  void begin_step();
  double take_step(double left);
  Attempt attempt(double step);
  double iteration_error() const;
  bool is_within_reach() const;
  void accept(double step, const Attempt &, bool is_cut);
  void shrink(double step, const Attempt &);
  void tell_of_reach(double step);
  void evaluate_trial();
  void settle();
  void renew_lists_at_beginning();
  bool lists_need_renewal() const;
  double largest_move(const double *position, double ahead) const;
  void set_clock(double step, double time);
  void displace_clock();
  void restore_clock();
  void stop(double step, const std::string &why) const;

  ExternalFields fields;
  blast::StepControl control;
  TrapezoidIteration iteration;
  ForceEvaluation forces;
  std::vector<class PairBlastContact *> contacts; // that are told what is a trial
  std::vector<class FixBlastLosses *> losses;     // and these of every step
  std::vector<class FixBlastWatch *> watches;

  double first_step = 0.0;
  double adapted_step = 0.0; // of the next step, where nothing cuts it
  double last_step = 0.0;    // the one that led to the present state
  double smallest_step = 0.0;
  double time = 0.0; // at the beginning of the present step
  Attempt last;
  bigint steps = 0, restarts = 0, evaluations = 0;
  FieldWorkTally tally;
  std::string history_name;
  const char *history_mode = nullptr;
  FILE *history = nullptr; // a row a step, on the first rank

  Clock clock_of_intervals;
  bool clock_is_displaced = false;
  std::vector<double> listed_position; // where atoms were when lists were built
  bool lists_are_fresh = false;        // built at the beginning of the present step
  bool has_told_of_reach = false;
};

} // namespace LAMMPS_NS

#endif
