/* The frame of F in plane strain, in closed form.
 *
 * With R(a) the rotation by a, M(a) the reflection [cos a, sin a; sin a, -cos a], and directions at angles α and β,
 *
 *   F = U diag(s) Vᵀ = (s_0 + s_1)/2 R(α - β) + (s_0 - s_1)/2 M(α + β),
 *
 * and both terms are read off F.
 */

/* Length of (x, y), and cos and sin of the angle along it: zero where there is no length. */
static inline lanes direction(lanes x, lanes y, lanes *cosine, lanes *sine)
{
  const lanes length = root(x * x + (y * y + 1e-300)), over = 1 / length;
  *cosine = (x + 1e-150) * over;
  *sine = y * over;
  return length;
}

/* H[i][j] = ∂u_i/∂X_j. */
static inline void decompose(const lanes H[3][3], struct frame *f)
{
  const lanes trace = H[0][0] + H[1][1];
#if OBJECTIVE
  const lanes x = 1 + 0.5 * trace, y = 0.5 * (H[1][0] - H[0][1]);
  lanes cos_turn, sin_turn;
  const lanes mean = direction(x, y, &cos_turn, &sin_turn);
  /* mean - 1 without cancellation. */
  const lanes excess = (trace * (1 + 0.25 * trace) + y * y) / (mean + 1);
#else
  const lanes x = all(1), y = all(0), mean = x, cos_turn = x, sin_turn = y, excess = 0.5 * trace;
#endif
  const lanes v = 0.5 * (H[0][0] - H[1][1]), w = 0.5 * (H[1][0] + H[0][1]);
  const lanes half_gap = root(v * v + w * w);

  /* cos and sin of 2β times half the gap. The smaller of the two angles that serve has no cancellation: the longer
   * stretch is the first or the second. */
  const lanes c = v * x + w * y, s = w * x - v * y;
  const lanes sign = with_sign(all(1), c);
  lanes cosine, sine;
  direction(mean * half_gap + magnitude(c), sign * s, &cosine, &sine);

  for (int n = 0; n < 3; ++n)
    for (int i = 0; i < 3; ++i)
      f->U[n][i] = f->V[n][i] = all(n == i);
  f->V[0][0] = f->V[1][1] = cosine;
  f->V[0][1] = sine;
  f->V[1][0] = -sine;
  f->U[0][0] = f->U[1][1] = cos_turn * cosine - sin_turn * sine;
  f->U[0][1] = sin_turn * cosine + cos_turn * sine;
  f->U[1][0] = -f->U[0][1];

  f->small = all(0) != all(0);
  const lanes difference = sign * half_gap;
  f->e[0] = excess + difference;
  f->e[1] = excess - difference;
  f->e[2] = all(0);
#if OBJECTIVE
  /* The smaller one from det F: all its digits. */
  const lanes longer = mean + half_gap;
  const lanes volume = (1 + H[0][0]) * (1 + H[1][1]) - H[0][1] * H[1][0];
  const lanes shorter = volume / longer;
  f->s[0] = larger(sign * longer, shorter);
  f->s[1] = larger(-sign * longer, shorter);
#else
  f->s[0] = 1 + f->e[0];
  f->s[1] = 1 + f->e[1];
#endif
  f->s[2] = all(1);
}
