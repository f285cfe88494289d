// The forces of section 9's near field between all pairs as one would write them down in an hour:
// a loop over columns that the compiler puts into vectors. Each pair is met once, and its force
// added to both; `tile` sources at a time, or all.

#include <algorithm>
#include <cmath>

extern "C" void plain_forces(int count, int tile, const double *__restrict x,
                             const double *__restrict y, const double *__restrict z,
                             double strength, double repulsion, double *__restrict fx,
                             double *__restrict fy, double *__restrict fz)
{
  for (int first = 0; first < count; first += tile) {
    const int end = std::min(count, first + tile);
    for (int i = 0; i < end; i++) {
      const double px = x[i], py = y[i], pz = z[i];
      double ax = 0.0, ay = 0.0, az = 0.0;
#pragma omp simd reduction(+ : ax, ay, az)
      for (int j = std::max(first, i + 1); j < end; j++) {
        const double dx = x[j] - px, dy = y[j] - py, dz = z[j] - pz;
        const double inverse = 1.0 / std::sqrt(dx * dx + dy * dy + dz * dz);
        const double force = inverse * inverse * (strength - repulsion * inverse);
        ax += force * dx;
        ay += force * dy;
        az += force * dz;
        fx[j] -= force * dx;
        fy[j] -= force * dy;
        fz[j] -= force * dz;
      }
      fx[i] += ax;
      fy[i] += ay;
      fz[i] += az;
    }
  }
}
