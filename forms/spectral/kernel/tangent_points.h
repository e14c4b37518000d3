/* The element matrix: moduli at each point, then products with the gradients of all pairs. */
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

KERNEL(tangent)
{
  UNUSED;
  lanes D[BATCHES][PRODUCTS][PRODUCTS];
  const int filter = (int)c[FILTER];
  for (int n = 0; n < BATCHES; ++n)
  {
    struct batch b;
    struct blocks blocks;
    load(n, w, coordinate_dofs, &b);
    tangent_blocks(&b.frame, c, &blocks);
    if (filter)
      filter_blocks(&blocks, filter);
    moduli(&b, &blocks, D[n]);
  }
  for (int a = 0; a < DOFS; ++a)
  {
    /* T[i][k][L] = Σ_J ∂_J φ_a D[iJ][kL], at each point. */
    lanes T[BATCHES][DIM][DIM][DIM];
    for (int n = 0; n < BATCHES; ++n)
      for (int i = 0; i < DIM; ++i)
        for (int y = 0; y < PRODUCTS; ++y)
        {
          lanes t = all(0);
          for (int j = 0; j < DIM; ++j)
            t += gradient_by_point[n][j][a] * D[n][i * DIM + j][y];
          T[n][i][y / DIM][y % DIM] = t;
        }
    for (int block = a / ROW; block < WIDTH / ROW; ++block)
    {
      row K[DIM][DIM];
      for (int i = 0; i < DIM; ++i)
        for (int k = 0; k < DIM; ++k)
          K[i][k] = (row){0};
      for (int q = 0; q < POINTS; ++q)
        for (int j = 0; j < DIM; ++j)
        {
          const row g = gradient_by_dof[q][j][block];
          for (int i = 0; i < DIM; ++i)
            for (int k = 0; k < DIM; ++k)
              K[i][k] += LANE(T[q / LANES][i][k][j], q % LANES) * g;
        }
      /* The element matrix is symmetric: the part below the diagonal is a copy. */
      for (int b = block * ROW; b < (block + 1) * ROW && b < DOFS; ++b)
        for (int i = 0; i < DIM; ++i)
          for (int k = 0; k < DIM; ++k)
          {
            const double value = K[i][k][b % ROW];
            if (b >= a)
              A[(DIM * a + i) * DIM * DOFS + DIM * b + k] += value;
            if (b > a)
              A[(DIM * b + k) * DIM * DOFS + DIM * a + i] += value;
          }
    }
  }
}
