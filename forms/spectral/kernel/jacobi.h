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

/* Diagonalises; the scale of G's columns is taken with `linear`, their own lengths without. */
static inline __attribute__((always_inline)) void jacobi(lanes G[3][3], lanes V[3][3], lanes linear, double quadratic,
                                                         int dim)
{
  static const int first[3] = {0, 0, 1}, second[3] = {1, 2, 2};
  const int pairs = dim == 2 ? 1 : 3;
  const lanes size = dot(G[0], G[0]) + dot(G[1], G[1]) + dot(G[2], G[2]);
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
      steepest = larger(steepest, 2 * s * s);
      turn(g, h, c, s);
      turn(v, w, c, s);
    }
    /* A later rotation brings back what an earlier one removed times its tangent, and no more; t² <= 2 s². */
    int again = 0;
    for (int r = 0; r < pairs; ++r)
      again |= any(off[r] * steepest > scale[r]);
    if (!again)
      return;
  }
}
