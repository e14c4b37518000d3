/* One double for each of LANES quadrature points: arithmetic on `lanes` is SIMD across points.
 *
 * With one lane these are plain scalars, so that a linear tetrahedron pays nothing for the rest.
 */
#pragma once
#if LANES == 1
/* Vectors made of scalars just stored cost more here than they save. */
#pragma GCC optimize("no-tree-vectorize")
#endif
#include <float.h>
#include <math.h>
#include <stdint.h>

#define FOR_LANES for (int l = 0; l < LANES; ++l)

#if LANES == 1
typedef double lanes;
typedef int mask;
#define LANE(x, l) (x)
static inline lanes choose(mask m, lanes yes, lanes no) { return __builtin_expect_with_probability(m, 1, 0.5) ? yes : no; }
#else
typedef double lanes __attribute__((vector_size(8 * LANES)));
typedef int64_t mask __attribute__((vector_size(8 * LANES)));
#define LANE(x, l) ((x)[l])
static inline lanes choose(mask m, lanes yes, lanes no)
{
  return (lanes)((m & (mask)yes) | (~m & (mask)no));
}
#endif

static inline lanes all(double x)
{
  lanes r;
  FOR_LANES LANE(r, l) = x;
  return r;
}

static inline int any(mask m)
{
  int64_t r = 0;
  FOR_LANES r |= LANE(m, l);
  return r != 0;
}

static inline lanes root(lanes x)
{
  lanes r;
  FOR_LANES LANE(r, l) = sqrt(LANE(x, l));
  return r;
}

static inline lanes magnitude(lanes x)
{
  lanes r;
  FOR_LANES LANE(r, l) = fabs(LANE(x, l));
  return r;
}

/* The size of x with the sign of y. */
static inline lanes with_sign(lanes x, lanes y)
{
  lanes r;
  FOR_LANES LANE(r, l) = copysign(LANE(x, l), LANE(y, l));
  return r;
}

static inline lanes larger(lanes a, lanes b) { return choose(a > b, a, b); }

static inline double sum(lanes x)
{
  double r = 0;
  FOR_LANES r += LANE(x, l);
  return r;
}

static inline lanes dot(const lanes a[3], const lanes b[3]) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
