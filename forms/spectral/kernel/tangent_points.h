/* The element matrix: moduli at each point, then products with the gradients of all pairs. */
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
