/* ψ, P and ∂P/∂F at given displacement gradients, through the same code as the element kernels. */
#include "generated.h"

#include "lanes.h"

#include "jacobi.h"

#include "frame.h"

#include "density.h"

#include "stress.h"

#include "tangent.h"

#include "filter.h"

static void one_batch(const lanes H[3][3], const double *c, lanes *psi, lanes P[9], lanes D[9][9], int second)
{
  struct frame f;
  struct jet jet = {0};
  struct blocks b;
  decompose(H, &f);
  energy_density(&f, c, &jet);
  principal_stress(&f, c, &jet);
  *psi = jet.psi;
  lanes M[3][3][9];
  for (int m = 0; m < 3; ++m)
    for (int n = 0; n < 3; ++n)
      for (int x = 0; x < 9; ++x)
        M[m][n][x] = f.U[m][x / 3] * f.V[n][x % 3];
  for (int x = 0; x < 9; ++x)
    P[x] = jet.p[0] * M[0][0][x] + jet.p[1] * M[1][1][x] + jet.p[2] * M[2][2][x];
  if (!second)
    return;
  tangent_blocks(&f, c, &b);
  if ((int)c[FILTER])
    filter_blocks(&b, (int)c[FILTER]);
  for (int x = 0; x < 9; ++x)
  {
    for (int y = 0; y < 9; ++y)
    {
      lanes d = all(0);
      for (int m = 0; m < 3; ++m)
        for (int n = 0; n < 3; ++n)
          d += b.h[m][n] * M[m][m][x] * M[n][n][y];
      for (int r = 0; r < 3; ++r)
      {
        const lanes *ij = M[pair_first[r]][pair_second[r]], *ji = M[pair_second[r]][pair_first[r]];
        d += 0.5 * b.plus[r] * (ij[x] + ji[x]) * (ij[y] + ji[y]);
        d += 0.5 * b.minus[r] * (ij[x] - ji[x]) * (ij[y] - ji[y]);
      }
      D[x][y] = d;
    }
  }
}

/* H has shape (n, 3, 3), c the material's constants, then filter and threshold; D may be null. */
void pointwise(int64_t n, const double *H, const double *c, double *psi, double *P, double *D)
{
  for (int64_t start = 0; start < n; start += LANES)
  {
    lanes h[3][3], value, p[9], d[9][9];
    for (int x = 0; x < 9; ++x)
      FOR_LANES LANE(h[x / 3][x % 3], l) = H[9 * (start + l < n ? start + l : n - 1) + x];
    one_batch(h, c, &value, p, d, D != 0);
    for (int l = 0; l < LANES && start + l < n; ++l)
    {
      psi[start + l] = LANE(value, l);
      for (int x = 0; x < 9; ++x)
      {
        P[9 * (start + l) + x] = LANE(p[x], l);
        for (int y = 0; D && y < 9; ++y)
          D[81 * (start + l) + 9 * x + y] = LANE(d[x][y], l);
      }
    }
  }
}
