// Shares loops over particles out among the threads that LAMMPS was given: OMP_NUM_THREADS, or the
// command `package omp`. Each thread has one run of the particles, the same in every step, so that
// sums taken thread by thread do not depend on who was faster.

#ifndef BLAST_STYLES_THREADS_H
#define BLAST_STYLES_THREADS_H

namespace LAMMPS_NS {

// The first particle of a thread; of thread + 1 the one after its last.
inline int first_of_thread(int thread, int threads, int count)
{
  return static_cast<int>(static_cast<long>(count) * thread / threads);
}

// Calls work(thread, first, end) for every thread at once. The work must not throw: an exception
// cannot leave its thread.
template <class Work> void in_threads(int threads, int count, const Work &work)
{
#pragma omp parallel for num_threads(threads) schedule(static, 1) if (threads > 1)
  for (int thread = 0; thread < threads; thread++)
    work(thread, first_of_thread(thread, threads, count),
         first_of_thread(thread + 1, threads, count));
}

} // namespace LAMMPS_NS

#endif
