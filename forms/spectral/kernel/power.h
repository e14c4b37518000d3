/* Powers in generated code: whole exponents known to the compiler are multiplied out, which -ffast-math alone does. */
#pragma once
#include <math.h>

static inline __attribute__((always_inline)) double power(double x, double y)
{
  if (__builtin_constant_p(y) && y == (int)y && y >= -8 && y <= 8)
  {
    const int n = y < 0 ? (int)-y : (int)y;
    double r = 1;
    for (int i = 0; i < n; ++i)
      r *= x;
    return y < 0 ? 1 / r : r;
  }
  return pow(x, y);
}
#define pow power
