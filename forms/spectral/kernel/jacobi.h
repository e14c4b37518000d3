/* Jacobi rotations of three columns.
 *
 * The columns g_p of G and v_p of V are rotated together until
 *
 *   linear (v_p·g_q + v_q·g_p) + quadratic g_p·g_q = 0   for p != q.
 *
 * Three problems are this one:
 *   linear 0, quadratic 1, G = F V:          one-sided Jacobi, the singular values of F, which is never squared;
 *   linear 1, quadratic 1, G = (F - I) V:    the same for small F - I: the identity, which v_p·v_q = 0 knows,
 *                                            is left out, so the strain keeps all its digits;
 *   linear 1, quadratic 0, G = A V:          the eigenvalues of a symmetric A.
 */

/* Rotations stop where what they would remove is below this part of what it is measured against. */
#define JACOBI_TOLERANCE 2.5e-16
#define JACOBI_SWEEPS 24

static inline void turn(lanes a[3], lanes b[3], lanes c, lanes s)
{
  for (int i = 0; i < 3; ++i)
  {
    const lanes x = a[i];
    a[i] = c * x - s * b[i];
    b[i] = s * x + c * b[i];
  }
}

/* A unit vector normal to the unit vector u. */
static inline void normal(const lanes u[3], lanes n[3])
{
  const lanes sign = choose(u[2] < 0, all(-1), all(1));
  const lanes a = -1 / (sign + u[2]);
  n[0] = 1 + sign * u[0] * u[0] * a;
  n[1] = sign * u[0] * u[1] * a;
  n[2] = -sign * u[0];
}

static inline void cross_product(const lanes a[3], const lanes b[3], lanes result[3])
{
  for (int i = 0; i < 3; ++i)
  {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    result[i] = a[j] * b[k] - a[k] * b[j];
  }
}

/* V from the identity to a good guess: v_2 is the eigenvector of the eigenvalue farthest from the other two, which
 * leaves one rotation of v_0 and v_1. With M - tr M/3 I = p B the eigenvalues x of B solve x³ - 3x = 2r, r = det B/2;
 * the farthest has the sign of r and lies between √3 and 2, where Newton's method is quick. */
static inline void first_guess(lanes G[3][3], lanes V[3][3], lanes linear, double quadratic)
{
  lanes B[3][3], C[3][3];
  for (int i = 0; i < 3; ++i)
    for (int j = i; j < 3; ++j)
      B[i][j] = B[j][i] = linear * (G[i][j] + G[j][i]) + quadratic * dot(G[i], G[j]);
  const lanes mean = (B[0][0] + B[1][1] + B[2][2]) / 3;
  for (int i = 0; i < 3; ++i)
    B[i][i] -= mean;
  const lanes p = root((dot(B[0], B[0]) + dot(B[1], B[1]) + dot(B[2], B[2])) / 6);
  const lanes over = 1 / (p + DBL_MIN);
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      B[i][j] *= over;
  cross_product(B[1], B[2], C[0]);
  const lanes r = 0.5 * dot(B[0], C[0]), size = magnitude(r);
  lanes x = 1.7320508075688772 + size * (0.33333333333333333 - 0.065384140902210563 * size);
  for (int step = 0; step < 2; ++step)
    x = (2 * x * x * x + 2 * size) / (3 * x * x - 3);
  x = choose(r < 0, -x, x);
  for (int i = 0; i < 3; ++i)
    B[i][i] -= x;
  /* Two rows span what v_2 is normal to: the pair with the longest cross product. */
  for (int i = 0; i < 3; ++i)
    cross_product(B[(i + 1) % 3], B[(i + 2) % 3], C[i]);
  lanes longest = dot(C[0], C[0]);
  for (int i = 1; i < 3; ++i)
  {
    const lanes length = dot(C[i], C[i]);
    const mask m = length > longest;
    longest = choose(m, length, longest);
    for (int k = 0; k < 3; ++k)
      C[0][k] = choose(m, C[i][k], C[0][k]);
  }
  /* It is at least √3, for any M: the other two eigenvalues of B - x are. */
  const lanes scaling = 1 / root(longest);
  for (int k = 0; k < 3; ++k)
    V[2][k] = C[0][k] * scaling;
  normal(V[2], V[0]);
  cross_product(V[2], V[0], V[1]);
  lanes old[3][3];
  for (int n = 0; n < 3; ++n)
    for (int i = 0; i < 3; ++i)
      old[n][i] = G[n][i];
  for (int n = 0; n < 3; ++n)
    for (int i = 0; i < 3; ++i)
      G[n][i] = V[n][0] * old[0][i] + V[n][1] * old[1][i] + V[n][2] * old[2][i];
}

/* Diagonalises; V is the identity on entry. The scale of G's columns is taken with `linear`, their own lengths
 * without. */
static inline __attribute__((always_inline)) void jacobi(lanes G[3][3], lanes V[3][3], lanes linear, double quadratic,
                                                         int dim)
{
  static const int first[3] = {0, 0, 1}, second[3] = {1, 2, 2};
  const int pairs = dim == 2 ? 1 : 3;
  const lanes size = dot(G[0], G[0]) + dot(G[1], G[1]) + dot(G[2], G[2]);
  if (dim == 3)
    first_guess(G, V, linear, quadratic);
  for (int sweep = 0; sweep < JACOBI_SWEEPS; ++sweep)
  {
    lanes off[3], scale[3], steepest = all(0);
    for (int r = 0; r < pairs; ++r)
    {
      lanes *g = G[first[r]], *h = G[second[r]], *v = V[first[r]], *w = V[second[r]];
      const lanes gg = dot(g, g), hh = dot(h, h);
      const lanes cross = linear * (dot(v, h) + dot(w, g)) + quadratic * dot(g, h);
      const lanes difference = 2 * linear * (dot(w, h) - dot(v, g)) + quadratic * (hh - gg);
      scale[r] = choose(linear > 0, size, gg * hh) * (JACOBI_TOLERANCE * JACOBI_TOLERANCE);
      off[r] = cross * cross;
#if LANES == 1
      if (off[r] <= scale[r])
        continue;
#endif
      const lanes twice = choose(difference < 0, -2 * cross, 2 * cross);
      const lanes length = root(difference * difference + twice * twice);
      /* (c, s) is (|difference| + length, twice), normalised: the smaller of the two angles that serve. */
      const lanes cosine = magnitude(difference) + length;
      const lanes scaling = 1 / root(cosine * cosine + twice * twice);
      const mask idle = off[r] <= scale[r];
      const lanes c = choose(idle, all(1), cosine * scaling), s = choose(idle, all(0), twice * scaling);
      if (r > 0)
        steepest = larger(steepest, 2 * s * s);
      turn(g, h, c, s);
      turn(v, w, c, s);
    }
    /* A rotation brings back into the pairs before it what it finds in those after it times its tangent, and no
     * more; t² <= 2 s². */
    int again = 0;
    for (int r = 1; r < pairs; ++r)
      again |= any(off[r] * steepest > scale[r]);
    if (!again)
      return;
  }
}
