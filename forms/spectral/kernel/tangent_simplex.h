/* The element matrix of a simplex of order one with a single point.
 *
 * The reference gradients of all nodes but the first are unit vectors: between these nodes the moduli themselves are
 * the matrix. A constant displacement does no work: what belongs to the first node is minus the sum over the others.
 */
#define UNKNOWNS (DIM * DOFS)

KERNEL(tangent)
{
  UNUSED;
  struct batch b;
  struct blocks blocks;
  lanes D[PRODUCTS][PRODUCTS];
  load(0, w, coordinate_dofs, &b);
  tangent_blocks(&b.frame, c, &blocks);
  if ((int)c[FILTER])
    filter_blocks(&blocks, (int)c[FILTER]);
  moduli(&b, &blocks, D);
  for (int i = 0; i < DIM; ++i)
    for (int k = 0; k < DIM; ++k)
    {
      double all = 0;
      for (int a = 0; a < DIM; ++a)
      {
        double sum = 0;
        for (int b = 0; b < DIM; ++b)
        {
          const double value = D[i * DIM + a][k * DIM + b];
          A[(DIM * (a + 1) + i) * UNKNOWNS + DIM * (b + 1) + k] += value;
          sum += value;
        }
        A[(DIM * (a + 1) + i) * UNKNOWNS + k] -= sum;
        A[k * UNKNOWNS + DIM * (a + 1) + i] -= sum;
        all += sum;
      }
      A[i * UNKNOWNS + k] += all;
    }
}
