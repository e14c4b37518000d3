/* Calls of a kernel on the packed data of many cells, as dolfinx makes them when it assembles, without insertion. */
#include <stdint.h>
#include <string.h>

/* The last argument is there from FFCx 0.10 on; earlier kernels do not look at it. */
typedef void (*kernel)(double *, const double *, const double *, const double *, const int *, const uint8_t *, void *);

void sweep(kernel tabulate, int64_t cells, double *A, int64_t entries, const double *w, int64_t coefficients,
           const double *c, const double *x, int64_t coordinates)
{
  const int entity = 0;
  const uint8_t permutation = 0;
  for (int64_t n = 0; n < cells; ++n)
  {
    memset(A, 0, sizeof(double) * entries);
    tabulate(A, w + n * coefficients, c, x + n * coordinates, &entity, &permutation, 0);
  }
}
