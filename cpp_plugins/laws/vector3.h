// Three-component vectors for the laws: just what the formulas need to read like the equations.

#ifndef BLAST_LAWS_VECTOR3_H
#define BLAST_LAWS_VECTOR3_H

#include <cmath>

namespace blast {

struct Vector3 {
  double x = 0.0, y = 0.0, z = 0.0;

  Vector3() = default;
  Vector3(double x_, double y_, double z_) : x(x_), y(y_), z(z_) {}
  explicit Vector3(const double *components) : x(components[0]), y(components[1]), z(components[2])
  {
  }

  void store(double *components) const
  {
    components[0] = x;
    components[1] = y;
    components[2] = z;
  }

  Vector3 &operator+=(const Vector3 &b)
  {
    x += b.x;
    y += b.y;
    z += b.z;
    return *this;
  }
};

inline Vector3 operator+(const Vector3 &a, const Vector3 &b)
{
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}

inline Vector3 operator-(const Vector3 &a, const Vector3 &b)
{
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}

inline Vector3 operator*(double s, const Vector3 &a)
{
  return {s * a.x, s * a.y, s * a.z};
}

inline double dot(const Vector3 &a, const Vector3 &b)
{
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

inline Vector3 cross(const Vector3 &a, const Vector3 &b)
{
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

inline double norm(const Vector3 &a)
{
  return std::sqrt(dot(a, a));
}

} // namespace blast

#endif
