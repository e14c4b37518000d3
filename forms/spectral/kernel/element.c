/* Energy, residual and tangent of one cell, in the interface of dolfinx's custom kernels.
 *
 * Quadrature points are taken LANES at a time. Generated for the element: DIM, POINTS, BATCHES, DOFS, NODES, ROW,
 * WIDTH (DOFS rounded up to ROW), the weights, and reference gradients of the basis in two layouts: with the points
 * of a batch side by side, and with the basis functions side by side. On simplices of order one (LINEAR; AFFINE if
 * the geometry is such a one) reference gradients are differences to the first node, the others being unit vectors.
 */
#include "generated.h"

#include "lanes.h"

#include "jacobi.h"

#include "frame.h"

#include "density.h"

#include "stress.h"

#include "tangent.h"

#include "filter.h"

#define KERNEL(name)                                                                                                   \
  void name(double *restrict A, const double *restrict w, const double *restrict c,                                    \
            const double *restrict coordinate_dofs, const int *restrict entity_local_index,                            \
            const uint8_t *restrict quadrature_permutation)
#define UNUSED (void)entity_local_index, (void)quadrature_permutation

/* A batch of points: frame, V pulled back to the reference cell, and weight times volume. */
struct batch
{
  struct frame frame;
  lanes pulled[3][DIM], weight;
};

/* K = det J J⁻¹. */
static inline lanes adjugate(const lanes J[DIM][DIM], lanes K[DIM][DIM])
{
#if DIM == 2
  K[0][0] = J[1][1];
  K[0][1] = -J[0][1];
  K[1][0] = -J[1][0];
  K[1][1] = J[0][0];
  return J[0][0] * J[1][1] - J[0][1] * J[1][0];
#else
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
    {
      const int a = (j + 1) % 3, b = (j + 2) % 3, d = (i + 1) % 3, e = (i + 2) % 3;
      K[i][j] = J[a][d] * J[b][e] - J[a][e] * J[b][d];
    }
  return J[0][0] * K[0][0] + J[0][1] * K[1][0] + J[0][2] * K[2][0];
#endif
}

/* The closed form of the plane is short enough to be compiled into each kernel. */
#if DIM == 2
#define PREPARE static inline __attribute__((always_inline))
#else
#define PREPARE static __attribute__((noinline))
#endif

PREPARE void load(int n, const double *w, const double *x, struct batch *b)
{
  lanes J[DIM][DIM], K[DIM][DIM], R[DIM][DIM], H[3][3];
  for (int i = 0; i < DIM; ++i)
    for (int j = 0; j < DIM; ++j)
    {
#if AFFINE
      J[i][j] = all(x[3 * (j + 1) + i] - x[i]);
#else
      J[i][j] = all(0);
      for (int a = 0; a < NODES; ++a)
        J[i][j] += x[3 * a + i] * geometry_by_point[n][j][a];
#endif
    }
  /* Products are taken while the processor divides. */
  const lanes det = adjugate(J, K), over = 1 / det;
#if LINEAR
  for (int i = 0; i < DIM; ++i)
    for (int j = 0; j < DIM; ++j)
      R[i][j] = all(w[DIM * (j + 1) + i] - w[i]);
#else
  for (int i = 0; i < DIM; ++i)
    for (int j = 0; j < DIM; ++j)
      R[i][j] = all(0);
  for (int a = 0; a < DOFS; ++a)
    for (int i = 0; i < DIM; ++i)
      for (int j = 0; j < DIM; ++j)
        R[i][j] += w[DIM * a + i] * gradient_by_point[n][j][a];
#endif
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
    {
      H[i][j] = all(0);
      if (i < DIM && j < DIM)
        for (int k = 0; k < DIM; ++k)
          H[i][j] += R[i][k] * K[k][j];
      H[i][j] *= over;
    }
  decompose(H, &b->frame);
  for (int m = 0; m < 3; ++m)
    for (int j = 0; j < DIM; ++j)
    {
      b->pulled[m][j] = all(0);
      for (int k = 0; k < DIM; ++k)
        b->pulled[m][j] += K[j][k] * b->frame.V[m][k];
      b->pulled[m][j] *= over;
    }
  b->weight = weights[n] * magnitude(det);
}

KERNEL(energy)
{
  UNUSED;
  for (int n = 0; n < BATCHES; ++n)
  {
    struct batch b;
    struct jet jet;
    load(n, w, coordinate_dofs, &b);
    energy_density(&b.frame, c, &jet);
    A[0] += sum(b.weight * jet.psi);
  }
}

KERNEL(residual)
{
  UNUSED;
  row R[DIM][WIDTH / ROW];
  for (int i = 0; i < DIM; ++i)
    for (int a = 0; a < WIDTH / ROW; ++a)
      R[i][a] = (row){0};
  for (int n = 0; n < BATCHES; ++n)
  {
    struct batch b;
    struct jet jet;
    load(n, w, coordinate_dofs, &b);
    principal_stress(&b.frame, c, &jet);
    lanes P[DIM][DIM];
    for (int i = 0; i < DIM; ++i)
      for (int j = 0; j < DIM; ++j)
      {
        P[i][j] = all(0);
        for (int m = 0; m < DIM; ++m)
          P[i][j] += jet.p[m] * b.frame.U[m][i] * b.pulled[m][j];
        P[i][j] *= b.weight;
      }
    for (int l = 0; l < LANES && n * LANES + l < POINTS; ++l)
      for (int j = 0; j < DIM; ++j)
        for (int a = 0; a < WIDTH / ROW; ++a)
        {
          const row g = gradient_by_dof[n * LANES + l][j][a];
          for (int i = 0; i < DIM; ++i)
            R[i][a] += LANE(P[i][j], l) * g;
        }
  }
  for (int a = 0; a < DOFS; ++a)
    for (int i = 0; i < DIM; ++i)
      A[DIM * a + i] += R[i][a / ROW][a % ROW];
}

#if LINEAR && LANES == 1
#include "tangent_simplex.h"
#else
#include "tangent_points.h"
#endif
