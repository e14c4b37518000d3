/* The element matrix of a simplex of order one with a single point, straight from the stretch frame.
 *
 * The reference gradients of all nodes but the first are unit vectors, in the frame the columns of V pulled back.
 * A constant displacement does no work: what belongs to the first node is minus the sum over the others.
 */
#define ENTRY(a, i, b, k) A[(DIM * (a) + (i)) * DIM * DOFS + DIM * (b) + (k)]

/* What the tangent makes of ∇φ_a and ∇φ_b with displacements along u_m and u_n. */
static inline void in_frame(const struct batch *b, const struct blocks *blocks, int first, int second,
                            double G[DIM][DIM])
{
  for (int m = 0; m < DIM; ++m)
    G[m][m] = blocks->h[m][m] * b->pulled[m][first] * b->pulled[m][second];
  for (int r = 0; r < PAIRS; ++r)
  {
    const int m = pair_first[r], n = pair_second[r];
    const double same = 0.5 * (blocks->plus[r] + blocks->minus[r]);
    const double swapped = 0.5 * (blocks->plus[r] - blocks->minus[r]);
    const double mn = b->pulled[m][first] * b->pulled[n][second], nm = b->pulled[n][first] * b->pulled[m][second];
    G[m][m] += same * b->pulled[n][first] * b->pulled[n][second];
    G[n][n] += same * b->pulled[m][first] * b->pulled[m][second];
    G[m][n] = blocks->h[m][n] * mn + swapped * nm;
    G[n][m] = blocks->h[m][n] * nm + swapped * mn;
  }
}

KERNEL(tangent)
{
  UNUSED;
  struct batch b;
  struct blocks blocks;
  load(0, w, coordinate_dofs, &b);
  tangent_blocks(&b.frame, c, &blocks);
  if ((int)c[FILTER])
    filter_blocks(&blocks, (int)c[FILTER]);

  /* sums[b]: of the blocks of column b + 1; in registers where the loops are unrolled. */
  double sums[DIM][DIM][DIM] = {{{0}}};
#pragma GCC unroll 3
  for (int first = 0; first < DIM; ++first)
#pragma GCC unroll 3
    for (int second = first; second < DIM; ++second)
    {
      double G[DIM][DIM], turned[DIM][DIM];
      in_frame(&b, &blocks, first, second, G);
      for (int m = 0; m < DIM; ++m)
        for (int k = 0; k < DIM; ++k)
        {
          turned[m][k] = 0;
          for (int n = 0; n < DIM; ++n)
            turned[m][k] += G[m][n] * b.frame.U[n][k];
          turned[m][k] *= b.weight;
        }
      for (int i = 0; i < DIM; ++i)
        for (int k = 0; k < DIM; ++k)
        {
          double value = 0;
          for (int m = 0; m < DIM; ++m)
            value += b.frame.U[m][i] * turned[m][k];
          ENTRY(first + 1, i, second + 1, k) += value;
          sums[second][i][k] += value;
          if (first != second)
          {
            ENTRY(second + 1, k, first + 1, i) += value;
            sums[first][k][i] += value;
          }
        }
    }
  for (int i = 0; i < DIM; ++i)
    for (int k = 0; k < DIM; ++k)
    {
      double all = 0;
      for (int a = 0; a < DIM; ++a)
      {
        ENTRY(0, i, a + 1, k) -= sums[a][i][k];
        ENTRY(a + 1, k, 0, i) -= sums[a][i][k];
        all += sums[a][i][k];
      }
      ENTRY(0, i, 0, k) += all;
    }
}
