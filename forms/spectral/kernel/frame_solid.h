/* The frame of F in three dimensions, by rotations of its columns: see jacobi.h. */

/* Puts the longer of two columns first; one changes its sign, so that V remains a rotation. */
static inline void sort(lanes G[3][3], lanes V[3][3], lanes size[3], int p, int q)
{
  const mask m = size[p] < size[q];
  const lanes length = size[p];
  size[p] = choose(m, size[q], length);
  size[q] = choose(m, length, size[q]);
  for (int i = 0; i < 3; ++i)
  {
    const lanes g = G[p][i], v = V[p][i];
    G[p][i] = choose(m, G[q][i], g);
    G[q][i] = choose(m, -g, G[q][i]);
    V[p][i] = choose(m, V[q][i], v);
    V[q][i] = choose(m, -v, V[q][i]);
  }
}

static inline void rotations(lanes G[3][3], struct frame *f, lanes linear)
{
  lanes B[3][3];
  for (int n = 0; n < 3; ++n)
    for (int i = 0; i < 3; ++i)
      B[n][i] = G[n][i] + linear * f->V[n][i];

  lanes(*U)[3] = f->U;
  const lanes first = root(dot(B[0], B[0]));
  const mask none = first == 0;
  for (int i = 0; i < 3; ++i)
    U[0][i] = choose(none, all(i == 0), B[0][i] / first);
  f->s[0] = first;
  /* The columns are orthogonal to their own precision; where the second is zero any normal serves. */
  lanes other[3];
  const lanes along = dot(U[0], B[1]);
  for (int i = 0; i < 3; ++i)
    B[1][i] -= along * U[0][i];
  const lanes second = root(dot(B[1], B[1]));
  const mask flat = second <= DBL_MIN;
  normal(U[0], other);
  for (int i = 0; i < 3; ++i)
    U[1][i] = choose(flat, other[i], B[1][i] / second);
  cross_product(U[0], U[1], U[2]);
  f->s[1] = dot(U[1], B[1]);
  f->s[2] = dot(U[2], B[2]);
}

/* H[i][j] = ∂u_i/∂X_j. */
static void decompose(const lanes H[3][3], struct frame *f)
{
  lanes G[3][3], squared = all(0);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
    {
      squared += H[i][j] * H[i][j];
      f->V[i][j] = all(i == j);
    }
#if OBJECTIVE
  /* Here the stretches lie between 1/2 and 3/2, and 1 + e is as exact as they can be. */
  f->small = squared < 0.25;
  const lanes linear = choose(f->small, all(1), all(0));
  for (int n = 0; n < 3; ++n)
    for (int i = 0; i < 3; ++i)
      G[n][i] = H[i][n] + (1 - linear) * f->V[n][i];
  jacobi(G, f->V, linear, 1, 3);

  lanes size[3];
  for (int n = 0; n < 3; ++n)
    size[n] = dot(G[n], G[n]) + 2 * linear * dot(f->V[n], G[n]);
  sort(G, f->V, size, 0, 1);
  sort(G, f->V, size, 1, 2);
  sort(G, f->V, size, 0, 1);
  rotations(G, f, linear);
  for (int n = 0; n < 3; ++n)
  {
    /* (s² - 1)/2 = E_n, the principal Green strain; s - 1 = 2 E_n / (1 + sqrt(1 + 2 E_n)). */
    const lanes exact = size[n] / (1 + root(1 + choose(f->small, size[n], all(0))));
    f->e[n] = choose(f->small, exact, f->s[n] - 1);
    f->s[n] = choose(f->small, 1 + exact, f->s[n]);
  }
#else
  /* Linear elasticity: principal values and directions of sym H, F taken as I + sym H. */
  (void)squared;
  f->small = all(0) == all(0);
  for (int n = 0; n < 3; ++n)
    for (int i = 0; i < 3; ++i)
      G[n][i] = 0.5 * (H[i][n] + H[n][i]);
  jacobi(G, f->V, all(1), 0, 3);
  for (int n = 0; n < 3; ++n)
  {
    f->e[n] = dot(f->V[n], G[n]);
    f->s[n] = 1 + f->e[n];
    for (int i = 0; i < 3; ++i)
      f->U[n][i] = f->V[n][i];
  }
#endif
}
