/* ∂P/∂F in the reference cell, from its blocks in the stretch frame. */
#define PRODUCTS (DIM * DIM)

/* D[x][y] = weight ∂P_x/∂F_y pulled back to the reference cell, x = (i, J), from its blocks on the u_i v_jᵀ. */
static inline void moduli(const struct batch *b, const struct blocks *blocks, lanes D[PRODUCTS][PRODUCTS])
{
  lanes M[PRODUCTS][PRODUCTS], Z[PRODUCTS][PRODUCTS];
  for (int m = 0; m < DIM; ++m)
    for (int n = 0; n < DIM; ++n)
      for (int i = 0; i < DIM; ++i)
        for (int j = 0; j < DIM; ++j)
          M[m * DIM + n][i * DIM + j] = b->frame.U[m][i] * b->pulled[n][j];
  for (int m = 0; m < DIM; ++m)
    for (int x = 0; x < PRODUCTS; ++x)
    {
      lanes z = all(0);
      for (int n = 0; n < DIM; ++n)
        z += b->weight * blocks->h[m][n] * M[n * DIM + n][x];
      Z[m * DIM + m][x] = z;
    }
  for (int r = 0; r < PAIRS; ++r)
  {
    const int ij = pair_first[r] * DIM + pair_second[r], ji = pair_second[r] * DIM + pair_first[r];
    const lanes same = 0.5 * b->weight * (blocks->plus[r] + blocks->minus[r]);
    const lanes swapped = 0.5 * b->weight * (blocks->plus[r] - blocks->minus[r]);
    for (int x = 0; x < PRODUCTS; ++x)
    {
      Z[ij][x] = same * M[ij][x] + swapped * M[ji][x];
      Z[ji][x] = same * M[ji][x] + swapped * M[ij][x];
    }
  }
  for (int x = 0; x < PRODUCTS; ++x)
    for (int y = x; y < PRODUCTS; ++y)
    {
      lanes d = all(0);
      for (int m = 0; m < PRODUCTS; ++m)
        d += M[m][x] * Z[m][y];
      D[x][y] = D[y][x] = d;
    }
}
