/* The element matrix of a single point, straight from the stretch frame: with N the number of unknowns of the cell,
 *
 *   A = Σ_mn X_mn ⊗ Y_mn,  X_mn[3a + i] = u_m[i] (v_n·∇φ_a),  Y = the blocks of the tangent applied to X.
 */
#define UNKNOWNS (DIM * DOFS)

KERNEL(tangent)
{
  UNUSED;
  struct batch b;
  struct blocks blocks;
  load(0, w, coordinate_dofs, &b);
  tangent_blocks(&b.frame, c, &blocks);
  if ((int)c[FILTER])
    filter_blocks(&blocks, (int)c[FILTER]);

  /* v_n·∇φ_a, and the components u_m[i], both repeated along the unknowns. */
  double along[DIM][UNKNOWNS], component[DIM][UNKNOWNS], X[DIM][DIM][UNKNOWNS], Y[DIM][DIM][UNKNOWNS];
  for (int n = 0; n < DIM; ++n)
    for (int a = 0; a < DOFS; ++a)
    {
      double g = 0;
      for (int j = 0; j < DIM; ++j)
        g += b.pulled[n][j] * gradient_by_point[0][j][a];
      for (int i = 0; i < DIM; ++i)
      {
        along[n][DIM * a + i] = g;
        component[n][DIM * a + i] = b.frame.U[n][i];
      }
    }
  for (int m = 0; m < DIM; ++m)
    for (int n = 0; n < DIM; ++n)
      for (int x = 0; x < UNKNOWNS; ++x)
        X[m][n][x] = component[m][x] * along[n][x];
  for (int m = 0; m < DIM; ++m)
    for (int x = 0; x < UNKNOWNS; ++x)
    {
      double y = 0;
      for (int n = 0; n < DIM; ++n)
        y += b.weight * blocks.h[m][n] * X[n][n][x];
      Y[m][m][x] = y;
    }
  for (int r = 0; r < PAIRS; ++r)
  {
    const int i = pair_first[r], j = pair_second[r];
    const double same = 0.5 * b.weight * (blocks.plus[r] + blocks.minus[r]);
    const double swapped = 0.5 * b.weight * (blocks.plus[r] - blocks.minus[r]);
    for (int x = 0; x < UNKNOWNS; ++x)
    {
      Y[i][j][x] = same * X[i][j][x] + swapped * X[j][i][x];
      Y[j][i][x] = same * X[j][i][x] + swapped * X[i][j][x];
    }
  }
  for (int a = 0; a < DOFS; ++a)
  {
    double Z[DIM][UNKNOWNS];
    for (int m = 0; m < DIM; ++m)
      for (int x = 0; x < UNKNOWNS; ++x)
      {
        double z = 0;
        for (int n = 0; n < DIM; ++n)
          z += along[n][DIM * a] * Y[m][n][x];
        Z[m][x] = z;
      }
    for (int i = 0; i < DIM; ++i)
      for (int x = 0; x < UNKNOWNS; ++x)
      {
        double value = 0;
        for (int m = 0; m < DIM; ++m)
          value += b.frame.U[m][i] * Z[m][x];
        A[(DIM * a + i) * UNKNOWNS + x] += value;
      }
  }
}
