/* Semi-definite tangents: eigenvalues below zero are clamped to it, or change their sign. */
#define FILTER_CLAMP 1
#define FILTER_ABSOLUTE 2

static inline lanes filtered(lanes x, int filter)
{
  return choose(x < 0, filter == FILTER_CLAMP ? all(0) : -x, x);
}

/* Where all pivots of the block are positive its eigenvalues are. */
static inline mask definite(const lanes h[3][3])
{
  const lanes first = h[0][0];
  const lanes second = h[1][1] - h[0][1] * h[0][1] / first;
  mask result = (first > 0) & (second > 0);
#if DIM == 3
  const lanes across = h[1][2] - h[0][1] * h[0][2] / first;
  result &= h[2][2] - h[0][2] * h[0][2] / first - across * across / second > 0;
#endif
  return result;
}

static inline void filter_blocks(struct blocks *b, int filter)
{
  for (int r = 0; r < PAIRS; ++r)
  {
    b->plus[r] = filtered(b->plus[r], filter);
    b->minus[r] = filtered(b->minus[r], filter);
  }
  const mask keep = definite(b->h);
  if (!any(keep == 0))
    return;
  lanes G[3][3], V[3][3];
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
    {
      /* In plane strain the third stretch does not change. */
      G[i][j] = i < DIM && j < DIM ? b->h[i][j] : all(0);
      V[i][j] = all(i == j);
    }
  jacobi(G, V, all(1), 0, DIM);
  lanes value[3];
  for (int n = 0; n < 3; ++n)
    value[n] = filtered(dot(V[n], G[n]), filter);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
    {
      const lanes h = value[0] * V[0][i] * V[0][j] + value[1] * V[1][i] * V[1][j] + value[2] * V[2][i] * V[2][j];
      b->h[i][j] = choose(keep, b->h[i][j], h);
    }
}
